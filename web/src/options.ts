// The options of a registration as fields: the common ones first.
import { h } from "./dom";

interface Field {
  name: string;
  label: string;
  help: string;
  kind: "number" | "integer" | "numbers" | "places" | "check" | "choice";
  choices?: readonly string[];
  /** Shown in an empty field. */
  hint?: string;
}

interface Group {
  title: string | null;
  fields: readonly Field[];
}

export const GROUPS: readonly Group[] = [
  {
    title: null,
    fields: [
      { name: "overlap", label: "Overlap", kind: "number", hint: "unknown", help: "Share of the source that the target shows too, from 0 to 1, if you know it." },
      { name: "scale", label: "Scale", kind: "choice", choices: ["fixed", "units", "free"], help: "“units” allows mm against m and the like; “free” any factor." },
      { name: "use_color", label: "Intensity and colour", kind: "choice", choices: ["auto", "never"], help: "“auto”: they settle what the surfaces leave free, like a painted wall." },
      { name: "yaw_only", label: "Both scans are levelled", kind: "check", help: "The pose then turns about the vertical alone." },
    ],
  },
  {
    title: "Accuracy",
    fields: [
      { name: "inlier_threshold", label: "Inlier threshold", kind: "number", hint: "estimated", help: "Largest distance of a pair of points, in the files' unit." },
      { name: "voxel_size", label: "Voxel size", kind: "number", hint: "1.5 % of the radius", help: "Cubes to which the clouds are thinned for the search; larger ones average noise." },
      { name: "ignore_file_viewpoints", label: "Ignore the scanners' positions in the files", kind: "check", help: "Where both files tell where the scanner stood, free space between it and the points tells wrong poses." },
      { name: "infer_viewpoints", label: "Scanners' positions from the order of the points", kind: "choice", choices: ["auto", "never"], help: "“auto”: raw scans tell where the scanner stood, and that tells wrong poses." },
      { name: "keep_no_data", label: "Keep rows that look like no measurement", kind: "check", help: "Zeros, -9999 and the like are left out otherwise." },
    ],
  },
  {
    title: "Start and scanners",
    fields: [
      { name: "initial_transform", label: "Approximate pose", kind: "numbers", hint: "16 numbers, row by row", help: "4×4 of the source in the target's frame; the search keeps near it." },
      { name: "max_rotation_deg", label: "Largest turn from it", kind: "number", hint: "30", help: "In degrees." },
      { name: "max_translation", label: "Largest shift from it", kind: "number", hint: "half a radius", help: "In the files' unit." },
      { name: "source_viewpoint", label: "Scanner of the source", kind: "places", hint: "x y z", help: "Its position in the source's frame, often 0 0 0; one after the other where several scans were merged. Give both: thin parts then do not flip." },
      { name: "target_viewpoint", label: "Scanner of the target", kind: "places", hint: "x y z", help: "Its position in the target's frame, or several." },
      { name: "source_gravity", label: "Gravity in the source", kind: "numbers", hint: "x y z", help: "Its direction, for example 0 0 -1. Give both." },
      { name: "target_gravity", label: "Gravity in the target", kind: "numbers", hint: "x y z", help: "Its direction in the target's frame." },
    ],
  },
  {
    title: "Method",
    fields: [
      { name: "method", label: "Method", kind: "choice", choices: ["mpl", "mpe"], help: "“mpl” searches all poses; “mpe” is the paper's local Algorithm 1." },
      { name: "search", label: "Search", kind: "choice", choices: ["global", "sparse"], help: "How “mpl” finds the coarse pose; “sparse” is local." },
      { name: "field", label: "Field", kind: "choice", choices: ["tree", "exact"], help: "How “mpe” sums forces: “exact” takes time with the square of the points." },
      { name: "sample_size", label: "Sample size", kind: "integer", hint: "1600", help: "Points of each cloud in the “sparse” search." },
      { name: "max_iterations", label: "Iterations", kind: "integer", hint: "100", help: "At most so many in each stage." },
      { name: "seed", label: "Seed", kind: "integer", hint: "0", help: "The same seed gives the same bits." },
    ],
  },
];

/** Whether a value of an option is what the service takes without it. */
export function isDefault(name: string, value: unknown): boolean {
  const field = GROUPS.flatMap(({ fields }) => fields).find((each) => each.name === name);
  if (value === null || value === false) return true;
  return value === field?.choices?.[0] || (field?.kind === "integer" && String(value) === field.hint);
}

type Input = HTMLInputElement | HTMLSelectElement;

/** Make the fields, and a function that reads what was filled in. */
export function makeOptions(): { element: HTMLElement; read: () => Record<string, unknown> } {
  const inputs = new Map<Field, Input>();
  const groups = GROUPS.map(({ title, fields }) => {
    const body = h("div", { className: "fields" }, ...fields.map((field) => makeField(field, inputs)));
    return title === null ? body : h("details", {}, h("summary", {}, title), body);
  });
  const element = h("details", { className: "options", id: "options" }, h("summary", {}, "Options"), ...groups);
  const read = (): Record<string, unknown> => {
    const entries = [...inputs].map(([field, input]) => [field.name, readField(field, input)] as const);
    return Object.fromEntries(entries.filter(([, value]) => value !== undefined));
  };
  return { element, read };
}

function makeField(field: Field, inputs: Map<Field, Input>): HTMLElement {
  const id = `option-${field.name}`;
  const described = { id, name: field.name, "aria-describedby": `${id}-help` };
  const input = makeInput(field, described);
  inputs.set(field, input);
  const label = h("label", { htmlFor: id }, field.label);
  const help = h("p", { className: "help", id: `${id}-help` }, field.help);
  const isCheck = field.kind === "check";
  return h("div", { className: isCheck ? "field check" : "field" }, ...(isCheck ? [input, label] : [label, input]), help);
}

function makeInput(field: Field, props: Record<string, unknown>): Input {
  if (field.kind === "choice") {
    return h("select", props, ...(field.choices ?? []).map((choice) => h("option", { value: choice }, choice)));
  }
  if (field.kind === "check") return h("input", { ...props, type: "checkbox" });
  const mode = field.kind === "integer" ? "numeric" : "decimal";
  return h("input", { ...props, type: "text", inputMode: mode, placeholder: field.hint ?? "", autocomplete: "off" });
}

function readField(field: Field, input: Input): unknown {
  if (field.kind === "choice") return input.value === field.choices?.[0] ? undefined : input.value;
  if (field.kind === "check") return (input as HTMLInputElement).checked ? true : undefined;
  const words = input.value.replace(/[[\](){};]/g, " ").split(/[\s,]+/).filter(Boolean);
  if (words.length === 0) return undefined;
  const numbers = words.map(Number);
  if (numbers.some(Number.isNaN)) throw new Error(`${field.label}: expected ${field.hint ?? "a number"}, got “${input.value}”.`);
  if (field.kind === "places" && numbers.length > 3) return inThrees(numbers);
  return field.kind === "numbers" || field.kind === "places" ? numbers : numbers[0];
}

function inThrees(numbers: readonly number[]): number[][] {
  const count = Math.ceil(numbers.length / 3);
  return Array.from({ length: count }, (_, i) => numbers.slice(3 * i, 3 * i + 3));
}
