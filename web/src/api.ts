// Calls of the service: the key, problems, and the documents that the page reads.

export type Matrix = number[][];

export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
}

export interface CloudInfo {
  sha256: string | null;
  size: number | null;
  url: string | null;
  cloud: string | null;
}

export interface Result {
  transform: Matrix;
  scale: number;
  rotation: { quaternion_xyzw: [number, number, number, number]; angle_deg: number };
  translation: [number, number, number];
  overlap: number;
  rmse: number;
  confidence: number;
  accepted: boolean;
  ambiguous: boolean;
  alternatives: Matrix[];
  covariance: Matrix;
  free_directions: number[][];
  converged: boolean;
  iterations: number;
  inliers: { count: number; ratio: number; threshold: number };
  warnings: { code: string; message: string }[];
}

export type Status = "queued" | "running" | "succeeded" | "failed" | "cancelled";

export interface JobSummary {
  id: string;
  status: Status;
  created_at: string;
  finished_at: string | null;
  progress: { stage: string; fraction: number };
  source: CloudInfo;
  target: CloudInfo;
  options: Record<string, unknown>;
  labels: Record<string, string>;
  confidence: number | null;
  cached: boolean;
  timing: Record<string, number | null>;
  result_expires_at: string | null;
  error: Problem | null;
}

export interface Job extends JobSummary {
  result: Result | null;
}

export const REGISTRATIONS = "/v1/registrations";
const KEY_NAME = "mpe-key";

/** What the service says is wrong, or that it does not answer. */
export class ApiError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail);
  }
}

export const NO_ANSWER: Problem = {
  type: "about:blank",
  title: "The service does not answer",
  status: 0,
  detail: "It may be stopped, or the network is down. Nothing is lost: try again.",
};

export function getKey(): string {
  return sessionStorage.getItem(KEY_NAME) ?? "";
}

/** Keep the key for this tab alone; an empty one is forgotten. */
export function setKey(key: string): void {
  if (key) sessionStorage.setItem(KEY_NAME, key);
  else sessionStorage.removeItem(KEY_NAME);
}

export function authorization(): Record<string, string> {
  const key = getKey();
  return key ? { Authorization: `Bearer ${key}` } : {};
}

/** Call the service; anything but a success is thrown as an ApiError. */
export async function call(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, { ...init, headers: { ...authorization(), ...init.headers } });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new ApiError(NO_ANSWER);
  }
  if (!response.ok) throw new ApiError(parseProblem(response.status, await response.text()));
  return response;
}

export function parseProblem(status: number, text: string): Problem {
  try {
    const problem = JSON.parse(text) as Problem;
    if (typeof problem.detail === "string") return problem;
  } catch {
    // a proxy in between has answered
  }
  return { type: "about:blank", title: `The service answered ${status}`, status, detail: "Try again later." };
}

export async function getJson<T>(path: string, init: RequestInit = {}): Promise<T> {
  return (await call(path, init)).json() as Promise<T>;
}

/** Save an answer as a file. */
export async function download(path: string, name: string): Promise<void> {
  const blob = await (await call(path)).blob();
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** The name of a cloud for people: its file's, its address, its id, or the start of its hash. */
export function nameCloud(job: JobSummary, role: "source" | "target"): string {
  const cloud = job[role];
  const label = job.labels[role];
  return label ?? cloud.cloud ?? cloud.url ?? `${(cloud.sha256 ?? "not fetched yet").slice(0, 12)}`;
}

export function isEnded(status: Status): boolean {
  return status === "succeeded" || status === "failed" || status === "cancelled";
}
