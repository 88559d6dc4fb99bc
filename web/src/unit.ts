// The unit of the files of the registration that is shown, as people name it; nothing is converted.
import type { Job } from "./api";
import { h } from "./dom";

const UNKNOWN = "units";
const COMMON = ["mm", "cm", "m", "in", "ft"];
let shown = UNKNOWN;

const keyOf = (job: Job): string => `mpe-unit-${job.id}`;

/** Take the unit that was named in this tab, else that of the label `unit`. */
export function takeUnit(job: Job): void {
  shown = sessionStorage.getItem(keyOf(job)) || job.labels.unit || UNKNOWN;
}

/** What is written behind lengths. */
export function unitName(): string {
  return shown;
}

/** The part of a query that names the unit, if it is known. */
export function unitQuery(): string {
  return shown === UNKNOWN ? "" : `?unit=${encodeURIComponent(shown)}`;
}

/** Make the field that names the unit; `onChange` shows the result anew. */
export function makeUnitField(job: Job, onChange: () => void): HTMLElement {
  const input = h("input", {
    id: "unit", type: "text", maxLength: 16, size: 6, list: "common-units", autocomplete: "off",
    value: shown === UNKNOWN ? "" : shown, placeholder: "mm",
  });
  input.addEventListener("change", () => {
    sessionStorage.setItem(keyOf(job), input.value.trim());
    onChange();
  });
  return h(
    "div",
    { className: "row" },
    h("label", { htmlFor: "unit" }, "Unit of the files"),
    input,
    h("datalist", { id: "common-units" }, ...COMMON.map((value) => h("option", { value }))),
  );
}
