// What is shown in place of a thing that is not there: loading, failed, unauthorised, expired, empty.
import { ApiError, getKey, setKey } from "./api";
import { announce, h } from "./dom";

/** Say what is wrong, with what can be done. */
export function showProblem(error: unknown, retry?: () => void): HTMLElement {
  if (error instanceof ApiError && error.problem.status === 401) return askForKey(error.problem.detail);
  const problem = error instanceof ApiError ? error.problem : null;
  const [title, detail] = problem
    ? [problem.title, problem.detail]
    : ["That did not work", error instanceof Error ? error.message : String(error)];
  announce(`${title}. ${detail}`);
  return h(
    "div",
    { className: "face problem", role: "alert" },
    h("h3", {}, title),
    h("p", {}, detail),
    problem && problem.status > 0 ? h("p", { className: "help" }, `${problem.status} · ${problem.type}`) : null,
    retry ? h("button", { type: "button", onclick: retry }, "Try again") : null,
  );
}

function askForKey(detail: string): HTMLElement {
  announce("A key is needed");
  return h(
    "div",
    { className: "face key", role: "alert" },
    h("h3", {}, getKey() ? "This key is not valid" : "A key is needed"),
    h("p", {}, detail),
    makeKeyForm("face-key"),
  );
}

/** Make the field for the key; it is kept in this tab alone. */
export function makeKeyForm(id: string): HTMLElement {
  const input = h("input", { id, type: "password", value: getKey(), autocomplete: "off", spellcheck: false });
  const form = h(
    "form",
    { className: "row" },
    h("label", { htmlFor: id }, "Key"),
    input,
    h("button", { type: "submit" }, "Use"),
    h("p", { className: "help" }, "Kept in this tab until it is closed, and sent to this service alone."),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    setKey(input.value.trim());
    dispatchEvent(new Event("keychange"));
  });
  return form;
}

export function showLoading(what: string): HTMLElement {
  return h("div", { className: "face", "aria-busy": "true" }, h("progress", { "aria-label": what }), h("p", {}, what));
}

export function showFace(title: string, text: string, ...actions: HTMLElement[]): HTMLElement {
  return h("div", { className: "face" }, h("h3", {}, title), h("p", {}, text), ...actions);
}
