// The 3-D view of both clouds.
import {
  Color, ColorManagement, LinearSRGBColorSpace, PerspectiveCamera, Plane, Scene, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Matrix } from "./api";
import { addArrows, type Arrows } from "./arrows";
import { colorPoints, SOURCE_COLOR, TARGET_COLOR, type ColorMode } from "./colors";
import { EyeDome } from "./eye_dome";
import { listenToKeys } from "./orbit_keys";
import { findPoint, listenToClicks } from "./picking";
import {
  blend, joinExtents, measureExtent, moveExtent, placeAfter, placeBefore, type Extent, type Placement,
} from "./placement";
import { makeMarker, makePoints, setColor, type CloudPoints } from "./points";
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
const MAX_PIXEL_RATIO = 2;
/** Waits for a frame that tell whether the graphics card keeps up, in milliseconds. */
const [FAST_MS, SLOW_MS] = [25, 50];
/** Least share of the points that is drawn while the view moves. */
const MIN_QUALITY = 0.1;
const REST_MS = 250;

ColorManagement.enabled = false;

export class Viewer {
  readonly movedBy: number;
  onPick: (pick: Pick | null) => void = () => {};
  onBlend: (share: number) => void = () => {};
  share = 0;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  /** Drawn over the points: arrows, and the point that was clicked on. */
  private readonly marks = new Scene();
  private readonly camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.1, 100);
  private readonly controls: OrbitControls;
  private readonly light: EyeDome;
  private readonly source: CloudPoints;
  private readonly target: CloudPoints;
  private readonly marker: CloudPoints;
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
  private quality = 1;
  private rest = 0;
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
    this.scene.add(this.target, this.source);
    this.marks.add(this.marker);
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
    listenToKeys(canvas, this.camera, this.controls, () => (this.isTurned = true), () => this.reset());
    listenToClicks(canvas, (event) => this.pick(event));
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
    distances?.forEach((distance, i) => Math.abs(distance) <= (threshold ?? Infinity) && kept.push(i));
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
    this.arrows = addArrows(this.marks, directions, moveExtent(this.extents.source, this.after));
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

  /** Draw soon; more calls until then are one. Where frames come late fewer points are drawn, and all at rest. */
  draw(): void {
    clearTimeout(this.rest);
    if (this.isDue) return;
    this.isDue = true;
    const asked = performance.now();
    requestAnimationFrame(() => {
      this.isDue = false;
      const waited = performance.now() - asked;
      if (waited > SLOW_MS) this.quality = Math.max(MIN_QUALITY, this.quality * 0.7);
      if (waited < FAST_MS) this.quality = Math.min(1, this.quality * 1.2);
      this.drawNow(this.quality);
      if (this.quality < 1) this.rest = window.setTimeout(() => this.drawNow(1), REST_MS);
    });
  }

  private drawNow(quality: number): void {
    let drawn = 0;
    for (const points of [this.source, this.target]) {
      const { index, attributes } = points.geometry;
      const count = Math.ceil((index?.count ?? attributes.position!.count) * quality);
      points.geometry.setDrawRange(0, count);
      if (points.visible) drawn += count;
    }
    const { radius, centre } = this.fitted();
    const distance = this.camera.position.distanceTo(centre);
    this.camera.far = distance + 4 * radius;
    this.camera.near = Math.max(this.camera.far * 1e-4, distance - 4 * radius);
    this.camera.updateProjectionMatrix();
    this.background.setStyle(getComputedStyle(this.place).backgroundColor);
    this.light.render(this.scene, this.marks, this.camera, this.background);
    this.place.dataset.share = String(this.share);
    this.place.dataset.drawn = quality === 1 ? "all" : String(drawn);
    this.place.dataset.frames = String(++this.frames);
  }

  dispose(): void {
    cancelAnimationFrame(this.animation);
    clearTimeout(this.rest);
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
    this.drawNow(1);
  }

  private pick(event: PointerEvent): void {
    const shown = [this.source, this.target].filter((points) => points.visible);
    const hit = findPoint(event, this.camera, this.controls.target, shown, this.planes);
    this.marker.visible = hit !== null;
    this.onPick(hit && this.describe(hit.points === this.source ? "source" : "target", hit.index));
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
