// The binary previews of clouds, as openapi.yaml describes them.
import { ApiError, call, NO_ANSWER, REGISTRATIONS } from "./api";

export interface Preview {
  /** Points of the whole cloud. */
  total: number;
  count: number;
  /** Where positions are counted from, in the frame of the file. */
  origin: [number, number, number];
  positions: Float32Array;
  /** Red, green, blue and 255 of each point. */
  colors: Uint8Array | null;
  /** Distance of each moved point from the surface of the target, negative behind it where that is known. */
  distances: Float32Array | null;
}

const HEADER_BYTES = 48;
const HAS_COLORS = 1;
const HAS_DISTANCES = 2;

export async function fetchPreview(id: string, role: "source" | "target", maxPoints: number): Promise<Preview> {
  const response = await call(`${REGISTRATIONS}/${id}/preview?role=${role}&max_points=${maxPoints}`);
  return parsePreview(await response.arrayBuffer());
}

export function parsePreview(content: ArrayBuffer): Preview {
  const view = new DataView(content);
  const magic = content.byteLength >= HEADER_BYTES ? view.getUint32(0, false) : 0;
  if (magic !== 0x4d504556 || view.getUint32(4, true) !== 1) {
    throw new ApiError({ ...NO_ANSWER, title: "The preview cannot be read", detail: "Load the page again." });
  }
  const flags = view.getUint32(8, true);
  const count = view.getUint32(12, true);
  let offset = HEADER_BYTES;
  const take = (bytes: number): number => (offset += bytes) - bytes;
  return {
    count,
    total: Number(view.getBigUint64(16, true)),
    origin: [view.getFloat64(24, true), view.getFloat64(32, true), view.getFloat64(40, true)],
    positions: new Float32Array(content, take(12 * count), 3 * count),
    colors: flags & HAS_COLORS ? new Uint8Array(content, take(4 * count), 4 * count) : null,
    distances: flags & HAS_DISTANCES ? new Float32Array(content, take(4 * count), count) : null,
  };
}
