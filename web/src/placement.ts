// Where the source is drawn: before, after, and in between.
// The frame of the scene is the target's, counted from the origin of its preview, so that clouds far
// from zero keep their precision on the graphics card.
import { Matrix4, Quaternion, Vector3 } from "three";
import type { Matrix } from "./api";
import type { Preview } from "./preview";

/** A similarity of the source's preview in the scene. */
export interface Placement {
  place: Vector3;
  turn: Quaternion;
  scale: number;
}

/** A sphere that holds nearly all points. */
export interface Extent {
  centre: Vector3;
  radius: number;
}

/** Distance of the clouds, in their radii, beyond which the source is drawn beside the target. */
const MAX_APART = 1.5;
const SAMPLED = 20_000;
const CUT = 0.005;

/** Where the file puts the source; `movedBy` is its distance from where it is drawn, or 0. */
export function placeBefore(source: Preview, target: Preview): { placement: Placement; movedBy: number } {
  const place = difference(source.origin, target.origin);
  const apart = measureExtent(source).radius + measureExtent(target).radius;
  const placement = { place, turn: new Quaternion(), scale: 1 };
  if (place.length() <= MAX_APART * apart) return { placement, movedBy: 0 };
  const drawn = place.clone().setLength(apart);
  return { placement: { ...placement, place: drawn }, movedBy: place.distanceTo(drawn) };
}

/** Where the pose puts the source. Sums are made before they are rounded. */
export function placeAfter(T: Matrix, source: Preview, target: Preview): Placement {
  const rows = [0, 1, 2].map((row) => T[row] ?? [0, 0, 0, 0]);
  const moved = rows.map(
    (row, i) => dot(row, source.origin) + (row[3] ?? 0) - (target.origin[i] ?? 0),
  );
  const [a, b, c] = rows as [number[], number[], number[]];
  const scale = Math.cbrt(determinant(a, b, c));
  const turn = new Matrix4().set(
    a[0]! / scale, a[1]! / scale, a[2]! / scale, 0,
    b[0]! / scale, b[1]! / scale, b[2]! / scale, 0,
    c[0]! / scale, c[1]! / scale, c[2]! / scale, 0,
    0, 0, 0, 1,
  );
  return { place: new Vector3(...moved), turn: new Quaternion().setFromRotationMatrix(turn), scale };
}

/** The placement between two, at a share of the way. */
export function blend(from: Placement, to: Placement, share: number): Placement {
  return {
    place: from.place.clone().lerp(to.place, share),
    turn: from.turn.clone().slerp(to.turn, share),
    scale: from.scale + (to.scale - from.scale) * share,
  };
}

/** A sphere about the points without the outermost ones. */
export function measureExtent(preview: Preview): Extent {
  const step = Math.max(1, Math.floor(preview.count / SAMPLED));
  const ranges = [0, 1, 2].map((axis) => {
    const values: number[] = [];
    for (let i = axis; i < preview.positions.length; i += 3 * step) values.push(preview.positions[i] ?? 0);
    values.sort((a, b) => a - b);
    const cut = Math.floor(values.length * CUT);
    return [values[cut] ?? 0, values[values.length - 1 - cut] ?? 0] as const;
  });
  const centre = new Vector3(...ranges.map(([low, high]) => (low + high) / 2));
  const half = new Vector3(...ranges.map(([low, high]) => (high - low) / 2));
  return { centre, radius: half.length() || 1 };
}

/** The smallest sphere about two. */
export function joinExtents(one: Extent, other: Extent): Extent {
  const apart = one.centre.distanceTo(other.centre);
  if (apart + other.radius <= one.radius) return one;
  if (apart + one.radius <= other.radius) return other;
  const radius = (apart + one.radius + other.radius) / 2;
  const centre = one.centre.clone().lerp(other.centre, (radius - one.radius) / apart);
  return { centre, radius };
}

/** The sphere of the source where it is placed. */
export function moveExtent(extent: Extent, { place, turn, scale }: Placement): Extent {
  const centre = extent.centre.clone().multiplyScalar(scale).applyQuaternion(turn).add(place);
  return { centre, radius: extent.radius * scale };
}

function difference(a: readonly number[], b: readonly number[]): Vector3 {
  return new Vector3(...[0, 1, 2].map((i) => (a[i] ?? 0) - (b[i] ?? 0)));
}

function dot(row: number[], point: readonly number[]): number {
  return row[0]! * point[0]! + row[1]! * point[1]! + row[2]! * point[2]!;
}

function determinant(a: number[], b: number[], c: number[]): number {
  return (
    a[0]! * (b[1]! * c[2]! - b[2]! * c[1]!) -
    a[1]! * (b[0]! * c[2]! - b[2]! * c[0]!) +
    a[2]! * (b[0]! * c[1]! - b[1]! * c[0]!)
  );
}
