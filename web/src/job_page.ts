// The page of one registration: its progress, then its result, or why there is none.
import { call, getJson, isEnded, nameCloud, REGISTRATIONS, type Job } from "./api";
import { announce, h } from "./dom";
import { followEvents } from "./events";
import { showFace, showLoading, showProblem } from "./faces";
import { showResult } from "./result_page";

const STAGES: Record<string, string> = {
  queued: "Waiting for a worker",
  fetch: "Fetching the files",
  decode: "Reading the files",
  prepare: "Preparing the clouds",
  search: "Searching all poses",
  refine: "Refining the pose",
  inliers: "Measuring how well it fits",
  store: "Writing the result",
  finished: "Finished",
};
const ORDER = ["queued", "decode", "prepare", "search", "refine", "inliers", "finished"];

/** Show the registration in the place until `signal` is aborted. */
export async function openJob(place: HTMLElement, id: string, signal: AbortSignal): Promise<void> {
  const path = `${REGISTRATIONS}/${encodeURIComponent(id)}`;
  place.replaceChildren(showLoading("Loading the registration"));
  try {
    let job = await getJson<Job>(path, { signal });
    if (!isEnded(job.status)) {
      await followProgress(place, job, path, signal);
      job = await getJson<Job>(path, { signal });
    }
    if (!signal.aborted) await showEnded(place, job, signal);
  } catch (error) {
    if (!signal.aborted) place.replaceChildren(showProblem(error, () => void openJob(place, id, signal)));
  }
}

async function followProgress(place: HTMLElement, job: Job, path: string, signal: AbortSignal): Promise<void> {
  const bar = h("progress", { max: 1, "aria-label": "Progress" });
  const stage = h("p", { className: "stage" });
  const steps = h("ol", { className: "steps" });
  const problem = h("div");
  const cancel = h("button", { type: "button" }, "Cancel");
  cancel.addEventListener("click", async () => {
    cancel.disabled = true;
    try {
      await call(path, { method: "DELETE" });
    } catch (error) {
      cancel.disabled = false;
      problem.replaceChildren(showProblem(error));
    }
  });
  place.replaceChildren(
    h("div", { className: "card running" }, makeTitle(job), bar, stage, steps, h("div", { className: "row" }, cancel), problem),
  );
  const show = (name: string, fraction: number): void => {
    bar.value = fraction;
    const text = STAGES[name] ?? name;
    if (stage.textContent !== text) announce(text);
    stage.textContent = text;
    const at = ORDER.indexOf(name);
    steps.replaceChildren(
      ...ORDER.slice(1, -1).map((each, i) => h("li", { className: i + 1 < at ? "done" : i + 1 === at ? "now" : "" }, STAGES[each] ?? each)),
    );
  };
  show(job.progress.stage, job.progress.fraction);
  await followEvents(path, (event) => show(event.stage, event.fraction), signal);
}

async function showEnded(place: HTMLElement, job: Job, signal: AbortSignal): Promise<void> {
  const again = h("a", { href: "#/", className: "button" }, "New registration");
  if (job.status === "succeeded" && job.result) return showResult(place, job, job.result, signal);
  const title = makeTitle(job);
  if (job.status === "succeeded") {
    const text = "Result and clouds were deleted after their time. Register the clouds again.";
    place.replaceChildren(h("div", { className: "card" }, title, showFace("The result has expired", text, again)));
  } else if (job.status === "cancelled") {
    const text = "It was cancelled before it ended; there is no result.";
    place.replaceChildren(h("div", { className: "card" }, title, showFace("Cancelled", text, again)));
  } else {
    const error = job.error;
    const face = h(
      "div",
      { className: "face problem", role: "alert" },
      h("h3", {}, error?.title ?? "It failed"),
      h("p", {}, error?.detail ?? ""),
      again,
    );
    announce(`${error?.title ?? "It failed"}. ${error?.detail ?? ""}`);
    place.replaceChildren(h("div", { className: "card" }, title, face));
  }
}

/** Make the heading: the names of the clouds. */
export function makeTitle(job: Job): HTMLElement {
  return h(
    "h1",
    { className: "clouds" },
    h("span", { className: "dot source" }),
    nameCloud(job, "source"),
    h("span", { className: "onto" }, " onto "),
    h("span", { className: "dot target" }),
    nameCloud(job, "target"),
  );
}
