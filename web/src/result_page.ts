// The result of a registration: verdict, 3-D view, numbers, files.
import type { Job, Result } from "./api";
import { announce, copyable, h } from "./dom";
import { showLoading, showProblem } from "./faces";
import { makeDownloads } from "./downloads";
import { makeHistogram } from "./histogram";
import { makeTitle } from "./job_page";
import { listDeviations, listPoseForms, short } from "./pose";
import { fetchPreview } from "./preview";
import { makeUnitField, takeUnit, unitName } from "./unit";
import { judge, percent, type Verdict } from "./verdict";
import { makeControls } from "./view_controls";
import { Viewer } from "./viewer";

const MAX_POINTS = 200_000;
const ICONS = { trust: "✓", check: "!", refuse: "✕" };

/** Show the result in the place; the view ends when `signal` is aborted. */
export async function showResult(place: HTMLElement, job: Job, result: Result, signal: AbortSignal): Promise<void> {
  takeUnit(job);
  const verdict = judge(result, unitName());
  const view = h("section", { className: "view", "aria-label": "3-D view" }, showLoading("Loading the clouds"));
  const distances = h("section", { className: "card", hidden: true });
  place.replaceChildren(
    h(
      "div",
      { className: "result" },
      makeTitle(job),
      h("div", { className: "side" }, makeVerdict(verdict), makeNumbers(job, result, () => void showResult(place, job, result, signal)), distances, makeOptionsCard(job)),
      h("div", { className: "main-column" }, view, h("div", { className: "more" }, makePoseCard(result), makeDownloads(job))),
    ),
  );
  announce(`${verdict.title}. ${verdict.summary}`);
  await showClouds(view, distances, job, result, signal);
}

async function showClouds(
  view: HTMLElement,
  distances: HTMLElement,
  job: Job,
  result: Result,
  signal: AbortSignal,
): Promise<void> {
  try {
    const [source, target] = await Promise.all([
      fetchPreview(job.id, "source", MAX_POINTS),
      fetchPreview(job.id, "target", MAX_POINTS),
    ]);
    if (signal.aborted) return;
    const stage = h("div", { className: "stage3d" });
    view.replaceChildren(stage);
    const viewer = new Viewer(stage, { source, target }, result.transform);
    signal.addEventListener("abort", () => viewer.dispose());
    const controls = makeControls(viewer, { source, target }, result);
    view.append(...controls);
    viewer.showFreeDirections(result.free_directions);
    if (source.distances) {
      distances.hidden = false;
      distances.replaceChildren(...makeHistogram(source.distances, result.inliers.threshold, unitName()));
    }
    viewer.animateTo(1);
  } catch (error) {
    if (!signal.aborted) {
      view.replaceChildren(showProblem(error, () => void showClouds(view, distances, job, result, signal)));
    }
  }
}

function makeVerdict(verdict: Verdict): HTMLElement {
  return h(
    "section",
    { className: `card verdict ${verdict.trust}`, "aria-label": "Verdict" },
    h("h2", {}, h("span", { className: "icon", "aria-hidden": "true" }, ICONS[verdict.trust]), verdict.title),
    h("p", {}, verdict.summary),
    h(
      "ul",
      { className: "reasons" },
      ...verdict.reasons.map(({ isGood, text }) => h("li", { className: isGood ? "good" : "doubt" }, text)),
    ),
  );
}

function makeNumbers(job: Job, result: Result, onUnit: () => void): HTMLElement {
  const { rotationDeg, translation } = listDeviations(result);
  const rows: [string, string][] = [
    ["Overlap", percent(result.overlap)],
    ["Distance (rms)", `${short(result.rmse)} ${unitName()}`],
    ["Inliers", `${result.inliers.count.toLocaleString("en")} within ${short(result.inliers.threshold)} ${unitName()}`],
    ["Turn", `${short(result.rotation.angle_deg)}°`],
    ["Shift", `${result.translation.map(short).join(", ")} ${unitName()}`],
    ...(result.scale === 1 ? [] : ([["Scale", short(result.scale)]] as [string, string][])),
    ["σ of the turn x, y, z", `${rotationDeg.map(short).join(", ")} °`],
    ["σ of the shift x, y, z", `${translation.map(short).join(", ")} ${unitName()}`],
    ["Time", job.cached ? "known from before" : `${short(job.timing.total_s ?? 0)} s`],
  ];
  return h(
    "section",
    { className: "card" },
    h("h2", {}, "Numbers"),
    h("dl", { className: "numbers" }, ...rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)])),
    makeUnitField(job, onUnit),
    h("p", { className: "help" }, "Lengths are in the unit of the files, which names them alone: nothing is converted. σ: standard deviation, about and along the target's axes."),
  );
}

function makePoseCard(result: Result): HTMLElement {
  const forms = listPoseForms(result);
  const choice = h("select", { id: "pose-form" }, ...forms.map(({ name }, i) => h("option", { value: i }, name)));
  const shown = h("div");
  const show = (): void => {
    const form = forms[Number(choice.value)];
    if (form) shown.replaceChildren(copyable(form.text, form.name));
  };
  choice.addEventListener("change", show);
  show();
  return h(
    "section",
    { className: "card" },
    h("h2", {}, "Pose"),
    h("div", { className: "row" }, h("label", { htmlFor: "pose-form" }, "Form"), choice),
    shown,
    h("p", { className: "help" }, "For column vectors: x in the target = R x in the source + t."),
  );
}

function makeOptionsCard(job: Job): HTMLElement {
  const given = Object.entries(job.options).filter(([, value]) => value !== null);
  const text = given.map(([name, value]) => `${name}: ${JSON.stringify(value)}`).join("\n");
  return h("details", { className: "card" }, h("summary", {}, "Options and hashes"), copyable(`${text}\nid: ${job.id}\nsource sha256: ${job.source.sha256 ?? ""}\ntarget sha256: ${job.target.sha256 ?? ""}`, "Options and hashes"));
}
