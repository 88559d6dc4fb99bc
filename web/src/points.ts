// Clouds as three.js draws them.
import { BufferAttribute, BufferGeometry, Points, PointsMaterial, type Plane } from "three";
import type { Preview } from "./preview";

export type CloudPoints = Points<BufferGeometry, PointsMaterial>;

export function makePoints(preview: Preview, planes: Plane[]): CloudPoints {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(preview.positions, 3));
  const material = new PointsMaterial({ size: 2, sizeAttenuation: false, vertexColors: true, clippingPlanes: planes });
  const points = new Points(geometry, material);
  points.frustumCulled = false;
  return points;
}

export function makeMarker(): CloudPoints {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(3), 3));
  const material = new PointsMaterial({ size: 12, sizeAttenuation: false, color: 0xff2d8d, depthTest: false });
  const marker = new Points(geometry, material);
  marker.visible = false;
  marker.frustumCulled = false;
  return marker;
}

export function setColor(points: CloudPoints, colors: Uint8Array): void {
  points.geometry.setAttribute("color", new BufferAttribute(colors, 3, true));
}
