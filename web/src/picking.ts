// Which point of a cloud is under the pointer.
import { Raycaster, Vector2, type PerspectiveCamera, type Plane, type Vector3 } from "three";
import type { CloudPoints } from "./points";

/** Distance on the screen at which a point is still hit. */
const REACH_PIXELS = 6;
/** Way of the pointer up to which it is a click and no drag. */
const MAX_WAY_PIXELS = 4;

/** Call for each click that is no drag. */
export function listenToClicks(canvas: HTMLCanvasElement, onClick: (event: PointerEvent) => void): void {
  let down = { x: 0, y: 0 };
  canvas.addEventListener("pointerdown", (event) => (down = { x: event.clientX, y: event.clientY }));
  canvas.addEventListener("pointerup", (event) => {
    if (Math.hypot(event.clientX - down.x, event.clientY - down.y) < MAX_WAY_PIXELS) onClick(event);
  });
}

/** Find the nearest point of the clouds that is not cut away; null where none is near. */
export function findPoint(
  event: PointerEvent,
  camera: PerspectiveCamera,
  focus: Vector3,
  clouds: CloudPoints[],
  planes: readonly Plane[],
): { points: CloudPoints; index: number } | null {
  const box = (event.target as HTMLElement).getBoundingClientRect();
  const caster = new Raycaster();
  const across = ((event.clientX - box.left) / box.width) * 2 - 1;
  caster.setFromCamera(new Vector2(across, 1 - ((event.clientY - box.top) / box.height) * 2), camera);
  const height = 2 * camera.position.distanceTo(focus) * Math.tan((camera.fov / 2) * (Math.PI / 180));
  caster.params.Points.threshold = (REACH_PIXELS * height) / box.height;
  const hit = caster
    .intersectObjects(clouds)
    .find(({ point }) => planes.every((plane) => plane.distanceToPoint(point) >= 0));
  return hit?.index === undefined ? null : { points: hit.object as CloudPoints, index: hit.index };
}
