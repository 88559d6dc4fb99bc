// One pose in the forms that programs and people use.
import type { Matrix, Result } from "./api";

export interface PoseForm {
  name: string;
  text: string;
}

const DEGREES = 180 / Math.PI;

/** Angles of R = Rz(yaw) Ry(pitch) Rx(roll), in degrees. */
export function toEuler(T: Matrix, scale: number): { yaw: number; pitch: number; roll: number } {
  const at = (row: number, column: number): number => (T[row]?.[column] ?? 0) / scale;
  const sine = Math.max(-1, Math.min(1, -at(2, 0)));
  const pitch = Math.asin(sine) * DEGREES;
  if (Math.abs(sine) > 1 - 1e-12) {
    return { yaw: Math.atan2(-at(0, 1), at(1, 1)) * DEGREES, pitch, roll: 0 };
  }
  return { yaw: Math.atan2(at(1, 0), at(0, 0)) * DEGREES, pitch, roll: Math.atan2(at(2, 1), at(2, 2)) * DEGREES };
}

export function listPoseForms(result: Result): PoseForm[] {
  const T = result.transform;
  const rows = T.map((row) => row.map(full));
  const columns = [0, 1, 2, 3].flatMap((column) => T.map((row) => full(row[column] ?? 0)));
  const euler = toEuler(T, result.scale);
  const t = result.translation.map(full);
  const scale = result.scale === 1 ? "" : `\nscale            ${full(result.scale)}`;
  return [
    { name: "4×4, row-major", text: `[${rows.map((row) => `[${row.join(", ")}]`).join(",\n ")}]` },
    { name: "4×4, column-major", text: `[${columns.join(", ")}]` },
    {
      name: "Quaternion and translation",
      text: `quaternion_xyzw  ${result.rotation.quaternion_xyzw.map(full).join(" ")}\ntranslation      ${t.join(" ")}${scale}`,
    },
    {
      name: "Euler angles, R = Rz(yaw) Ry(pitch) Rx(roll)",
      text:
        `yaw   (z)  ${full(euler.yaw)}°\npitch (y)  ${full(euler.pitch)}°\nroll  (x)  ${full(euler.roll)}°\n` +
        `translation  ${t.join(" ")}${scale}`,
    },
    { name: "CloudCompare: Edit > Apply transformation", text: rows.map((row) => row.join(" ")).join("\n") },
    {
      name: "Open3D, Python",
      text: `import numpy as np\nT = np.array([${rows.map((row) => `[${row.join(", ")}]`).join(",\n              ")}])\nsource.transform(T)`,
    },
  ];
}

/** Standard deviations of the pose: about and along the target's axes. */
export function listDeviations(result: Result): { rotationDeg: number[]; translation: number[] } {
  const sigma = [0, 1, 2, 3, 4, 5].map((i) => Math.sqrt(Math.max(0, result.covariance[i]?.[i] ?? 0)));
  return { rotationDeg: sigma.slice(0, 3).map((value) => value * DEGREES), translation: sigma.slice(3) };
}

function full(value: number): string {
  return String(Object.is(value, -0) ? 0 : value);
}

/** Four significant digits, without an exponent where that is short. */
export function short(value: number): string {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(2);
  return Number(value.toPrecision(4)).toLocaleString("en", { maximumSignificantDigits: 4 });
}
