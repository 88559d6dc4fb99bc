// All registrations: newest first, by state, searched, page by page.
import { getJson, nameCloud, REGISTRATIONS, type JobSummary } from "./api";
import { h } from "./dom";
import { showFace, showLoading, showProblem } from "./faces";
import { percent } from "./verdict";

const PAGE_SIZE = 25;
const STATES = ["succeeded", "running", "queued", "failed", "cancelled"];

interface Page {
  items: JobSummary[];
  next_cursor: string | null;
}

/** Show the list in the place until `signal` is aborted. */
export async function openList(place: HTMLElement, signal: AbortSignal): Promise<void> {
  const jobs: JobSummary[] = [];
  let cursor: string | null = null;
  const state = h("select", { id: "state" }, h("option", { value: "" }, "Any state"), ...STATES.map((name) => h("option", { value: name }, name)));
  const search = h("input", { id: "search", type: "search", placeholder: "Name or id", autocomplete: "off" });
  const body = h("div", { className: "list" });
  const more = h("button", { type: "button", hidden: true }, "Load more");

  const show = (): void => {
    const words = search.value.trim().toLowerCase();
    const found = jobs.filter((job) => describe(job).includes(words));
    body.replaceChildren(found.length ? makeTable(found) : makeEmpty(jobs.length > 0 || state.value !== ""));
    more.hidden = cursor === null;
  };
  const load = async (): Promise<void> => {
    more.disabled = true;
    const only = state.value ? `&status=${state.value}` : "";
    const after = cursor ? `&cursor=${encodeURIComponent(cursor)}` : "";
    try {
      const page: Page = await getJson<Page>(`${REGISTRATIONS}?limit=${PAGE_SIZE}${only}${after}`, { signal });
      jobs.push(...page.items);
      cursor = page.next_cursor;
      show();
    } catch (error) {
      if (!signal.aborted) body.replaceChildren(showProblem(error, () => void load()));
    }
    more.disabled = false;
  };
  const restart = (): void => {
    jobs.length = 0;
    cursor = null;
    body.replaceChildren(showLoading("Loading the registrations"));
    void load();
  };
  state.addEventListener("change", restart);
  search.addEventListener("input", show);
  more.addEventListener("click", () => void load());
  place.replaceChildren(
    h(
      "section",
      { className: "card registrations" },
      h("h1", {}, "Registrations"),
      h("div", { className: "row filters" }, h("label", { htmlFor: "search" }, "Search"), search, h("label", { htmlFor: "state" }, "State"), state),
      body,
      more,
    ),
  );
  restart();
}

function describe(job: JobSummary): string {
  return `${job.id} ${nameCloud(job, "source")} ${nameCloud(job, "target")} ${job.status}`.toLowerCase();
}

function makeTable(jobs: JobSummary[]): HTMLElement {
  const heads = ["Clouds", "State", "Confidence", "Submitted"];
  return h(
    "table",
    {},
    h("thead", {}, h("tr", {}, ...heads.map((text) => h("th", { scope: "col" }, text)))),
    h("tbody", {}, ...jobs.map(makeRow)),
  );
}

function makeRow(job: JobSummary): HTMLElement {
  const trust = job.confidence === null ? "" : job.confidence >= 0.9 ? "good" : job.confidence >= 0.5 ? "fair" : "bad";
  return h(
    "tr",
    {},
    h("td", {}, h("a", { href: `#/registrations/${job.id}` }, `${nameCloud(job, "source")} onto ${nameCloud(job, "target")}`)),
    h("td", {}, h("span", { className: `state ${job.status}` }, job.status)),
    h("td", {}, job.confidence === null ? "–" : h("span", { className: `confidence ${trust}` }, percent(job.confidence))),
    h("td", {}, new Date(job.created_at).toLocaleString()),
  );
}

function makeEmpty(isFiltered: boolean): HTMLElement {
  const link = h("a", { href: "#/", className: "button" }, "Align two clouds");
  return isFiltered
    ? showFace("None found", "No registration on these pages matches. Load more, or change the search.")
    : showFace("No registrations yet", "What you align shows up here, until it expires.", link);
}
