// Colours of points: by cloud, by their own colour, by distance.
import type { Preview } from "./preview";

export type ColorMode = "cloud" | "own" | "distance";

type Rgb = readonly [number, number, number];

export const SOURCE_COLOR: Rgb = [240, 130, 44];
export const TARGET_COLOR: Rgb = [66, 139, 226];
/** Share of the inliers that the scale of distances spans. */
const SHOWN_SHARE = 0.98;
const PALE: Rgb = [150, 156, 165];

/** Anchors of the scale of distances (blue to red). */
const RAMP: readonly Rgb[] = [
  [48, 93, 214],
  [34, 165, 190],
  [62, 190, 96],
  [240, 200, 50],
  [222, 56, 42],
];

/** The colour of a share of the range; above it that of its end. */
export function rampColor(share: number): Rgb {
  const place = Math.max(0, Math.min(1, share)) * (RAMP.length - 1);
  const index = Math.min(RAMP.length - 2, Math.floor(place));
  const [low, high] = [RAMP[index]!, RAMP[index + 1]!];
  const part = place - index;
  return [0, 1, 2].map((i) => Math.round(low[i]! + (high[i]! - low[i]!) * part)) as unknown as Rgb;
}

/** The colour of a distance; signed ones run from minus the range to the range. */
export function distanceColor(distance: number, range: number, isSigned: boolean): Rgb {
  return rampColor(isSigned ? (distance / range + 1) / 2 : distance / range);
}

/** Whether some points lie behind the surface. */
export function areSigned(distances: Float32Array): boolean {
  return distances.some((distance) => distance < 0);
}

/** The distance up to which nearly all points that have a counterpart lie; two digits. */
export function chooseRange(distances: Float32Array, threshold: number): number {
  const near = distances.map(Math.abs).filter((distance) => distance <= threshold).sort();
  const most = near[Math.floor(SHOWN_SHARE * (near.length - 1))] || threshold || 1;
  return Number(most.toPrecision(2));
}

/** Colours (3 bytes a point) of a cloud. */
export function colorPoints(
  preview: Preview,
  mode: ColorMode,
  plain: Rgb,
  range: number,
): Uint8Array {
  const colors = new Uint8Array(3 * preview.count);
  if (mode === "own" && preview.colors) {
    for (let i = 0; i < preview.count; i++) colors.set(preview.colors.subarray(4 * i, 4 * i + 3), 3 * i);
    return colors;
  }
  if (mode === "distance" && preview.distances) {
    const isSigned = areSigned(preview.distances);
    preview.distances.forEach((distance, i) => colors.set(distanceColor(distance, range, isSigned), 3 * i));
    return colors;
  }
  const color = mode === "distance" ? PALE : plain;
  for (let i = 0; i < preview.count; i++) colors.set(color, 3 * i);
  return colors;
}

/** Draw the scale of distances from left to right. */
export function drawRamp(canvas: HTMLCanvasElement): void {
  const context = canvas.getContext("2d");
  if (!context) return;
  for (let x = 0; x < canvas.width; x++) {
    context.fillStyle = `rgb(${rampColor(x / (canvas.width - 1)).join(",")})`;
    context.fillRect(x, 0, 1, canvas.height);
  }
}
