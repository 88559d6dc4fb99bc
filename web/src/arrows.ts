// Motions that the surfaces leave free: arrows along a slide, an axis with rings about a turn.
import { ArrowHelper, BufferGeometry, Group, Line, LineBasicMaterial, Scene, Vector3 } from "three";
import type { Extent } from "./placement";

export type Arrows = Group;

const COLOR = 0xd6219a;
const RING_POINTS = 64;

/** Add one mark for each motion: rotation vector about the centre, then translation. */
export function addArrows(scene: Scene, directions: readonly number[][], extent: Extent): Arrows {
  const group = new Group();
  for (const motion of directions) {
    const [x = 0, y = 0, z = 0, u = 0, v = 0, w = 0] = motion;
    const [turn, slide] = [new Vector3(x, y, z), new Vector3(u, v, w)];
    if (slide.length() >= turn.length() * extent.radius) addSlide(group, slide.normalize(), extent);
    else addTurn(group, turn.normalize(), extent);
  }
  scene.add(group);
  return group;
}

function addSlide(group: Group, direction: Vector3, { centre, radius }: Extent): void {
  for (const sign of [1, -1]) {
    const along = direction.clone().multiplyScalar(sign);
    group.add(new ArrowHelper(along, centre, radius, COLOR, radius * 0.15, radius * 0.08));
  }
}

function addTurn(group: Group, axis: Vector3, { centre, radius }: Extent): void {
  const side = new Vector3(1, 0, 0).cross(axis);
  if (side.length() < 0.1) side.set(0, 1, 0).cross(axis);
  const first = side.normalize();
  const second = axis.clone().cross(first);
  const ring = Array.from({ length: RING_POINTS + 1 }, (_, i) => {
    const angle = (i / RING_POINTS) * 2 * Math.PI;
    return centre
      .clone()
      .addScaledVector(first, Math.cos(angle) * radius * 0.7)
      .addScaledVector(second, Math.sin(angle) * radius * 0.7);
  });
  const material = new LineBasicMaterial({ color: COLOR });
  group.add(new Line(new BufferGeometry().setFromPoints(ring), material));
  const ends = [-1, 1].map((sign) => centre.clone().addScaledVector(axis, sign * radius));
  group.add(new Line(new BufferGeometry().setFromPoints(ends), material));
}
