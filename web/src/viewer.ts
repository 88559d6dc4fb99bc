// The 3-D view of both clouds.
import {
  BufferAttribute, BufferGeometry, Color, ColorManagement, LinearSRGBColorSpace, PerspectiveCamera, Plane, Points,
  PointsMaterial, Raycaster, Scene, Vector2, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Matrix } from "./api";
import { addArrows, type Arrows } from "./arrows";
import { colorPoints, SOURCE_COLOR, TARGET_COLOR, type ColorMode } from "./colors";
import { EyeDome } from "./eye_dome";
import {
  blend, joinExtents, measureExtent, moveExtent, placeAfter, placeBefore, type Extent, type Placement,
} from "./placement";
import type { Preview } from "./preview";

export type View = "home" | "top" | "front" | "side";

export interface Pick {
  cloud: "source" | "target";
  /** In the frame of its file. */
  inFile: Vector3Tuple;
  /** In the frame of the target. */
  inTarget: Vector3Tuple;
  distance: number | null;
}
type Vector3Tuple = [number, number, number];

const DIRECTIONS: Record<View, Vector3Tuple> = {
  home: [0.7, -1, 0.55],
  top: [0, -1e-4, 1],
  front: [0, -1, 0],
  side: [1, 0, 0],
};
const BLEND_MS = 1600;
const FIELD_OF_VIEW_DEG = 40;
const PICK_PIXELS = 6;
const MAX_PIXEL_RATIO = 2;

ColorManagement.enabled = false;

export class Viewer {
  readonly movedBy: number;
  onPick: (pick: Pick | null) => void = () => {};
  onBlend: (share: number) => void = () => {};
  share = 0;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.1, 100);
  private readonly controls: OrbitControls;
  private readonly light: EyeDome;
  private readonly source: Points<BufferGeometry, PointsMaterial>;
  private readonly target: Points<BufferGeometry, PointsMaterial>;
  private readonly marker: Points<BufferGeometry, PointsMaterial>;
  private readonly before: Placement;
  private readonly extents: { source: Extent; target: Extent };
  private readonly observer: ResizeObserver;
  private readonly planes: Plane[] = [];
  private after: Placement;
  private arrows: Arrows | null = null;
  private background = new Color();
  private animation = 0;
  private frames = 0;
  private isDue = false;
  private isTurned = false;

  constructor(
    private readonly place: HTMLElement,
    private readonly previews: { source: Preview; target: Preview },
    T: Matrix,
  ) {
    this.renderer = new WebGLRenderer({ antialias: false, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    this.renderer.localClippingEnabled = true;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO));
    this.light = new EyeDome(this.renderer);
    this.extents = { source: measureExtent(previews.source), target: measureExtent(previews.target) };
    const { placement, movedBy } = placeBefore(previews.source, previews.target);
    this.before = placement;
    this.movedBy = movedBy;
    this.after = placeAfter(T, previews.source, previews.target);
    this.target = makePoints(previews.target, this.planes);
    this.source = makePoints(previews.source, this.planes);
    this.marker = makeMarker();
    this.scene.add(this.target, this.source, this.marker);
    this.camera.up.set(0, 0, 1);
    const canvas = this.renderer.domElement;
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => (this.isTurned = true));
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute(
      "aria-label",
      "Both clouds in 3-D. Drag or arrow keys turn, plus and minus zoom, Home resets the view.",
    );
    canvas.addEventListener("keydown", (event) => this.onKey(event));
    this.listenToClicks(canvas);
    place.append(canvas);
    this.setColors("cloud", 1);
    this.setShare(0);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(place);
    this.resize();
    this.reset();
  }

  /** Show another pose of the source. */
  setPose(T: Matrix): void {
    this.after = placeAfter(T, this.previews.source, this.previews.target);
    this.setShare(this.share);
  }

  /** Show the source at a share of the way from before to after. */
  setShare(share: number): void {
    this.share = share;
    const { place, turn, scale } = blend(this.before, this.after, share);
    this.source.position.copy(place);
    this.source.quaternion.copy(turn);
    this.source.scale.setScalar(scale);
    this.marker.visible = false;
    if (this.arrows) this.arrows.visible = share === 1;
    if (!this.isTurned) this.look(null);
    this.onBlend(share);
    this.draw();
  }

  /** Move slowly to before (0) or after (1). */
  animateTo(goal: 0 | 1, duration = BLEND_MS): void {
    cancelAnimationFrame(this.animation);
    const [from, start] = [this.share, performance.now()];
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) duration = 1;
    const step = (now: number): void => {
      const t = Math.max(0, Math.min(1, (now - start) / duration));
      this.setShare(t === 1 ? goal : from + (goal - from) * t * t * (3 - 2 * t));
      if (t < 1) this.animation = requestAnimationFrame(step);
    };
    this.animation = requestAnimationFrame(step);
  }

  setColors(mode: ColorMode, range: number): void {
    const { source, target } = this.previews;
    setColor(this.source, colorPoints(source, mode, SOURCE_COLOR, range));
    setColor(this.target, colorPoints(target, mode, TARGET_COLOR, range));
    this.draw();
  }

  setPointSize(pixels: number): void {
    for (const points of [this.source, this.target]) {
      points.material.size = pixels * this.renderer.getPixelRatio();
    }
    this.draw();
  }

  setOpacity(opacity: number): void {
    for (const points of [this.source, this.target]) {
      points.material.opacity = opacity;
      points.material.transparent = opacity < 1;
      points.material.needsUpdate = true;
    }
    this.draw();
  }

  setVisible(cloud: "source" | "target", isVisible: boolean): void {
    this[cloud].visible = isVisible;
    this.draw();
  }

  /** Show the points of the source up to this distance alone; null: all. */
  setInliers(threshold: number | null): void {
    const { distances } = this.previews.source;
    const kept: number[] = [];
    distances?.forEach((distance, i) => distance <= (threshold ?? Infinity) && kept.push(i));
    this.source.geometry.setIndex(threshold === null || !distances ? null : kept);
    this.draw();
  }

  /** Cut everything outside of a box, given as shares [low, high] of each axis of the scene. */
  setSection(shares: readonly (readonly [number, number])[]): void {
    const { centre, radius } = this.fitted();
    this.planes.length = 0;
    shares.forEach(([low, high], axis) => {
      const at = (share: number): number => centre.getComponent(axis) + (2 * share - 1) * radius;
      const normal = new Vector3().setComponent(axis, 1);
      if (low > 0) this.planes.push(new Plane(normal.clone(), -at(low)));
      if (high < 1) this.planes.push(new Plane(normal.clone().negate(), at(high)));
    });
    for (const points of [this.source, this.target]) {
      points.material.clippingPlanes = [...this.planes];
      points.material.needsUpdate = true;
    }
    this.draw();
  }

  /** Draw motions that the surfaces leave free as arrows at the moved source. */
  showFreeDirections(directions: readonly number[][]): void {
    if (directions.length === 0) return;
    this.arrows = addArrows(this.scene, directions, moveExtent(this.extents.source, this.after));
    this.arrows.visible = this.share === 1;
    this.draw();
  }

  reset(): void {
    this.isTurned = false;
    this.look("home");
  }

  look(view: View | null): void {
    const { centre, radius } = this.fitted();
    const direction = view
      ? new Vector3(...DIRECTIONS[view])
      : this.camera.position.clone().sub(this.controls.target);
    const half = (FIELD_OF_VIEW_DEG / 2) * (Math.PI / 180);
    const narrow = Math.min(1, this.camera.aspect);
    const distance = (radius * 0.9) / Math.sin(Math.atan(Math.tan(half) * narrow));
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(direction.normalize(), distance);
    if (view && view !== "home") this.isTurned = true;
    this.controls.update();
    this.draw();
  }

  /** Draw soon; more calls until then are one. */
  draw(): void {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      this.drawNow();
    });
  }

  drawNow(): void {
    const { radius, centre } = this.fitted();
    const distance = this.camera.position.distanceTo(centre);
    this.camera.far = distance + 4 * radius;
    this.camera.near = Math.max(this.camera.far * 1e-4, distance - 4 * radius);
    this.camera.updateProjectionMatrix();
    this.background.setStyle(getComputedStyle(this.place).backgroundColor);
    this.light.render(this.scene, this.camera, this.background);
    this.place.dataset.share = String(this.share);
    this.place.dataset.frames = String(++this.frames);
  }

  dispose(): void {
    cancelAnimationFrame(this.animation);
    this.observer.disconnect();
    this.controls.dispose();
    this.light.dispose();
    for (const points of [this.source, this.target, this.marker]) {
      points.geometry.dispose();
      points.material.dispose();
    }
    this.renderer.dispose();
  }

  private fitted(): Extent {
    const placement = blend(this.before, this.after, this.share);
    return joinExtents(this.extents.target, moveExtent(this.extents.source, placement));
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    const ratio = this.renderer.getPixelRatio();
    this.light.setSize(Math.floor(width * ratio), Math.floor(height * ratio));
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (!this.isTurned) this.look(null);
    this.drawNow();
  }

  private onKey(event: KeyboardEvent): void {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [-0.15, 0, 1], ArrowRight: [0.15, 0, 1], ArrowUp: [0, -0.12, 1], ArrowDown: [0, 0.12, 1],
      "+": [0, 0, 0.85], "=": [0, 0, 0.85], "-": [0, 0, 1.18],
    };
    if (event.key === "Home") this.reset();
    const turn = turns[event.key];
    if (turn) this.turn(...turn);
    if (turn || event.key === "Home") event.preventDefault();
  }

  private turn(azimuth: number, polar: number, zoom: number): void {
    this.isTurned = true;
    const offset = this.camera.position.clone().sub(this.controls.target);
    const flat = Math.hypot(offset.x, offset.y);
    const length = offset.length() * zoom;
    const phi = Math.atan2(offset.y, offset.x) + azimuth;
    const theta = Math.max(1e-3, Math.min(Math.PI - 1e-3, Math.atan2(flat, offset.z) + polar));
    offset.set(Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta));
    this.camera.position.copy(this.controls.target).addScaledVector(offset, length);
    this.controls.update();
  }

  private listenToClicks(canvas: HTMLCanvasElement): void {
    let down = { x: 0, y: 0 };
    canvas.addEventListener("pointerdown", (event) => (down = { x: event.clientX, y: event.clientY }));
    canvas.addEventListener("pointerup", (event) => {
      if (Math.hypot(event.clientX - down.x, event.clientY - down.y) < 4) this.pick(event);
    });
  }

  private pick(event: PointerEvent): void {
    const box = this.renderer.domElement.getBoundingClientRect();
    const at = new Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
    );
    const caster = new Raycaster();
    caster.setFromCamera(at, this.camera);
    const distance = this.camera.position.distanceTo(this.controls.target);
    const height = 2 * distance * Math.tan((FIELD_OF_VIEW_DEG / 2) * (Math.PI / 180));
    caster.params.Points.threshold = (PICK_PIXELS * height) / box.height;
    const shown = [this.source, this.target].filter((points) => points.visible);
    const hits = caster
      .intersectObjects(shown)
      .filter(({ point }) => this.planes.every((plane) => plane.distanceToPoint(point) >= 0));
    const hit = hits[0];
    this.marker.visible = hit !== undefined;
    if (!hit || hit.index === undefined) {
      this.onPick(null);
      return this.draw();
    }
    const role = hit.object === this.source ? "source" : "target";
    this.onPick(this.describe(role, hit.index));
    this.draw();
  }

  private describe(role: "source" | "target", index: number): Pick {
    const preview = this.previews[role];
    const local = [0, 1, 2].map((i) => preview.positions[3 * index + i] ?? 0) as Vector3Tuple;
    const inFile = local.map((value, i) => value + preview.origin[i]!) as Vector3Tuple;
    const world = this[role].localToWorld(new Vector3(...local));
    this.marker.position.copy(world);
    const origin = this.previews.target.origin;
    const inTarget = world.toArray().map((value, i) => value + origin[i]!) as Vector3Tuple;
    const distance = role === "source" ? (preview.distances?.[index] ?? null) : null;
    return { cloud: role, inFile, inTarget, distance };
  }
}

function makePoints(preview: Preview, planes: Plane[]): Points<BufferGeometry, PointsMaterial> {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(preview.positions, 3));
  const material = new PointsMaterial({ size: 2, sizeAttenuation: false, vertexColors: true, clippingPlanes: planes });
  const points = new Points(geometry, material);
  points.frustumCulled = false;
  return points;
}

function makeMarker(): Points<BufferGeometry, PointsMaterial> {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(3), 3));
  const material = new PointsMaterial({ size: 12, sizeAttenuation: false, color: 0xff2d8d, depthTest: false });
  const marker = new Points(geometry, material);
  marker.visible = false;
  marker.frustumCulled = false;
  return marker;
}

function setColor(points: Points<BufferGeometry, PointsMaterial>, colors: Uint8Array): void {
  points.geometry.setAttribute("color", new BufferAttribute(colors, 3, true));
}
