// Turning and zooming the camera by the keyboard.
import type { PerspectiveCamera } from "three";
import type { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

type Turn = readonly [azimuth: number, polar: number, zoom: number];

const TURNS: Readonly<Record<string, Turn>> = {
  ArrowLeft: [-0.15, 0, 1],
  ArrowRight: [0.15, 0, 1],
  ArrowUp: [0, -0.12, 1],
  ArrowDown: [0, 0.12, 1],
  "+": [0, 0, 0.85],
  "=": [0, 0, 0.85],
  "-": [0, 0, 1.18],
};
const MIN_POLAR = 1e-3;

/** Listen on the canvas; `onTurn` is called before a turn, `onReset` for Home. */
export function listenToKeys(
  canvas: HTMLCanvasElement,
  camera: PerspectiveCamera,
  controls: OrbitControls,
  onTurn: () => void,
  onReset: () => void,
): void {
  canvas.addEventListener("keydown", (event) => {
    const turn = TURNS[event.key];
    if (!turn && event.key !== "Home") return;
    event.preventDefault();
    if (!turn) return onReset();
    onTurn();
    orbit(camera, controls, turn);
  });
}

function orbit(camera: PerspectiveCamera, controls: OrbitControls, [azimuth, polar, zoom]: Turn): void {
  const offset = camera.position.clone().sub(controls.target);
  const length = offset.length() * zoom;
  const phi = Math.atan2(offset.y, offset.x) + azimuth;
  const angle = Math.atan2(Math.hypot(offset.x, offset.y), offset.z) + polar;
  const theta = Math.max(MIN_POLAR, Math.min(Math.PI - MIN_POLAR, angle));
  offset.set(Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta));
  camera.position.copy(controls.target).addScaledVector(offset, length);
  controls.update();
}
