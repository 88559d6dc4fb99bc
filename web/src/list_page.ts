// All registrations: newest first, by state, searched, page by page.
import { getJson, nameCloud, REGISTRATIONS, type JobSummary } from "./api";
import { h } from "./dom";
import { showFace, showLoading, showProblem } from "./faces";
import { percent } from "./verdict";

const PAGE_SIZE = 25;
/** Rest after a keystroke before the service searches, in milliseconds. */
const REST_MS = 250;
const MAX_SEARCH_LENGTH = 200;
const STATES = ["succeeded", "running", "queued", "failed", "cancelled"];

interface Page {
  items: JobSummary[];
  next_cursor: string | null;
}

/** Show the list in the place until `signal` is aborted. */
export async function openList(place: HTMLElement, signal: AbortSignal): Promise<void> {
  const jobs: JobSummary[] = [];
  let cursor: string | null = null;
  let asked = new AbortController();
  let rest = 0;
  const state = h("select", { id: "state" }, h("option", { value: "" }, "Any state"), ...STATES.map((name) => h("option", { value: name }, name)));
  const search = h("input", { id: "search", type: "search", placeholder: "Name, label, URL or id", maxLength: MAX_SEARCH_LENGTH, autocomplete: "off" });
  const body = h("div", { className: "list" });
  const more = h("button", { type: "button", hidden: true }, "Load more");

  const show = (): void => {
    const isFiltered = search.value.trim() !== "" || state.value !== "";
    body.replaceChildren(jobs.length ? makeTable(jobs) : makeEmpty(isFiltered));
    more.hidden = cursor === null;
  };
  const load = async (): Promise<void> => {
    const { signal: current } = asked;
    more.disabled = true;
    const query = new URLSearchParams({ limit: String(PAGE_SIZE) });
    if (state.value) query.set("status", state.value);
    if (search.value.trim()) query.set("search", search.value.trim());
    if (cursor) query.set("cursor", cursor);
    try {
      const page: Page = await getJson<Page>(`${REGISTRATIONS}?${query}`, { signal: current });
      if (cursor === null) jobs.length = 0;
      jobs.push(...page.items);
      cursor = page.next_cursor;
      show();
    } catch (error) {
      if (!current.aborted) body.replaceChildren(showProblem(error, () => void load()));
    }
    if (!current.aborted) more.disabled = false;
  };
  const restart = (): void => {
    clearTimeout(rest);
    asked.abort();
    asked = new AbortController();
    cursor = null;
    void load();
  };
  signal.addEventListener("abort", () => {
    clearTimeout(rest);
    asked.abort();
  });
  state.addEventListener("change", restart);
  search.addEventListener("input", () => {
    clearTimeout(rest);
    rest = window.setTimeout(restart, REST_MS);
  });
  more.addEventListener("click", () => void load());
  place.replaceChildren(
    h(
      "section",
      { className: "card registrations" },
      h("h1", {}, "Registrations"),
      h(
        "div",
        { className: "row filters" },
        h("div", { className: "group" }, h("label", { htmlFor: "search" }, "Search"), search),
        h("div", { className: "group" }, h("label", { htmlFor: "state" }, "State"), state),
      ),
      body,
      more,
    ),
  );
  body.replaceChildren(showLoading("Loading the registrations"));
  restart();
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
    h("td", { className: job.confidence === null ? "none" : "" }, job.confidence === null ? "–" : h("span", { className: `confidence ${trust}` }, percent(job.confidence))),
    h("td", {}, new Date(job.created_at).toLocaleString()),
  );
}

function makeEmpty(isFiltered: boolean): HTMLElement {
  const link = h("a", { href: "#/", className: "button" }, "Align two clouds");
  return isFiltered
    ? showFace("None found", "No registration matches. Change the search or the state; what has expired is gone.")
    : showFace("No registrations yet", "What you align shows up here, until it expires.", link);
}
