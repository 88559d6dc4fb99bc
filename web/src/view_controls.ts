// The controls of the 3-D view.
import type { Matrix, Result } from "./api";
import { areSigned, chooseRange, drawRamp, type ColorMode } from "./colors";
import { h } from "./dom";
import { short } from "./pose";
import type { Preview } from "./preview";
import { unitName } from "./unit";
import type { Pick, View, Viewer } from "./viewer";

const VIEWS: readonly [View, string][] = [["home", "Reset"], ["top", "Top"], ["front", "Front"], ["side", "Side"]];

type Previews = { source: Preview; target: Preview };

/** Make the bars of controls for a viewer. */
export function makeControls(viewer: Viewer, previews: Previews, result: Result): HTMLElement[] {
  const colors = makeColors(viewer, previews, result);
  return [
    makeBlend(viewer),
    h(
      "div",
      { className: "bar" },
      h("div", { className: "group", role: "group", "aria-label": "View" }, ...VIEWS.map(([view, name]) =>
        h("button", { type: "button", className: "small", onclick: () => (view === "home" ? viewer.reset() : viewer.look(view)) }, name))),
      colors.choice,
      makeAlternatives(viewer, result, colors.setHasDistances),
    ),
    colors.legend,
    makePicked(viewer),
    makeDrawing(viewer, previews, result),
    makeNotes(viewer, previews),
  ];
}

function makeBlend(viewer: Viewer): HTMLElement {
  const slider = h("input", { type: "range", id: "blend", min: 0, max: 1, step: 0.01, value: "0", "aria-label": "From before to after" });
  const before = h("button", { type: "button", onclick: () => viewer.animateTo(0) }, "Before");
  const after = h("button", { type: "button", onclick: () => viewer.animateTo(1) }, "After");
  slider.addEventListener("input", () => viewer.setShare(Number(slider.value)));
  viewer.onBlend = (share) => {
    slider.value = String(share);
    before.setAttribute("aria-pressed", String(share === 0));
    after.setAttribute("aria-pressed", String(share === 1));
  };
  return h("div", { className: "bar blend", role: "group", "aria-label": "Before and after" }, before, slider, after);
}

function makeColors(
  viewer: Viewer,
  previews: Previews,
  result: Result,
): { choice: HTMLElement; legend: HTMLElement; setHasDistances: (has: boolean) => void } {
  const select = h("select", { id: "colors" });
  const own = previews.source.colors || previews.target.colors;
  const options: [ColorMode, string, boolean][] = [
    ["cloud", "by cloud", true],
    ["distance", "by distance", previews.source.distances !== null],
    ["own", "own colours", own !== null],
  ];
  for (const [value, name, has] of options) if (has) select.append(h("option", { value }, name));
  const start = previews.source.distances ? chooseRange(previews.source.distances, result.inliers.threshold) : 1;
  const range = h("input", { id: "range", type: "number", min: 0, step: "any", value: start });
  const ramp = h("canvas", { width: 256, height: 12, className: "ramp", "aria-hidden": "true" });
  drawRamp(ramp);
  const isSigned = previews.source.distances !== null && areSigned(previews.source.distances);
  const low = h("span", {}, "0");
  const scale = h("div", { className: "bar legend scale", hidden: true }, low, ramp,
    h("label", { htmlFor: "range" }, "to"), range, h("span", {}, `${unitName()} and more`));
  const names = h("div", { className: "bar legend" }, h("span", { className: "dot source" }), "Source", h("span", { className: "dot target" }), "Target");
  const show = (): void => {
    const mode = select.value as ColorMode;
    scale.hidden = mode !== "distance";
    names.hidden = mode !== "cloud";
    low.textContent = isSigned ? `−${range.value}` : "0";
    viewer.setColors(mode, Number(range.value) > 0 ? Number(range.value) : 1);
  };
  select.addEventListener("change", show);
  range.addEventListener("input", show);
  const setHasDistances = (has: boolean): void => {
    const option = select.querySelector<HTMLOptionElement>("option[value=distance]");
    if (option) option.disabled = !has;
    if (!has && select.value === "distance") select.value = "cloud";
    show();
  };
  return {
    choice: h("div", { className: "group" }, h("label", { htmlFor: "colors" }, "Colours"), select),
    legend: h("div", {}, names, scale),
    setHasDistances,
  };
}

function makeAlternatives(viewer: Viewer, result: Result, setHasDistances: (has: boolean) => void): HTMLElement | null {
  if (result.alternatives.length === 0) return null;
  const poses: Matrix[] = [result.transform, ...result.alternatives];
  const select = h("select", { id: "alternatives" }, ...poses.map((_, i) => h("option", { value: i }, i === 0 ? "Best" : `Alternative ${i}`)));
  select.addEventListener("change", () => {
    const pose = poses[Number(select.value)];
    if (pose) viewer.setPose(pose);
    setHasDistances(select.value === "0");
    viewer.animateTo(1);
  });
  return h("div", { className: "group" }, h("label", { htmlFor: "alternatives" }, "Pose"), select);
}

function makePicked(viewer: Viewer): HTMLElement {
  const place = h("div", { className: "picked", role: "status" }, h("p", { className: "help" }, "Click a point for its coordinates."));
  const show = (pick: Pick): HTMLElement[] => [
    h("span", { className: `dot ${pick.cloud}` }),
    h("span", {}, `${pick.cloud}: ${pick.inFile.map(exact).join(", ")}`),
    ...(pick.cloud === "source" ? [h("span", {}, `in the target's frame: ${pick.inTarget.map(exact).join(", ")}`)] : []),
    ...(pick.distance === null ? [] : [h("span", {}, `distance from the surface when aligned: ${short(pick.distance)} ${unitName()}`)]),
  ];
  viewer.onPick = (pick) => place.replaceChildren(...(pick ? show(pick) : [h("p", { className: "help" }, "No point there.")]));
  return place;
}

function exact(value: number): string {
  return Number(value.toPrecision(9)).toString();
}

function makeDrawing(viewer: Viewer, previews: Previews, result: Result): HTMLElement {
  const slider = (id: string, label: string, [min, max, step, value]: number[], apply: (value: number) => void): HTMLElement => {
    const input = h("input", { type: "range", id, min, max, step, value: String(value) });
    input.addEventListener("input", () => apply(Number(input.value)));
    return h("div", { className: "group" }, h("label", { htmlFor: id }, label), input);
  };
  const check = (id: string, label: string, isOn: boolean, apply: (isOn: boolean) => void): HTMLElement => {
    const input = h("input", { type: "checkbox", id, checked: isOn });
    input.addEventListener("change", () => apply(input.checked));
    return h("div", { className: "group" }, input, h("label", { htmlFor: id }, label));
  };
  const section = [0, 1, 2].map(() => [0, 1] as [number, number]);
  const axes = ["x", "y", "z"].flatMap((name, axis) =>
    (["from", "to"] as const).map((side, end) =>
      slider(`cut-${name}-${side}`, `${name} ${side}`, [0, 1, 0.005, end], (value) => {
        section[axis]![end] = value;
        viewer.setSection(section);
      }),
    ),
  );
  return h(
    "details",
    { className: "drawing" },
    h("summary", {}, "Points and section box"),
    h(
      "div",
      { className: "bar" },
      slider("size", "Point size", [1, 8, 0.5, 2], (value) => viewer.setPointSize(value)),
      slider("opacity", "Opacity", [0.1, 1, 0.05, 1], (value) => viewer.setOpacity(value)),
      check("show-source", "Source", true, (isOn) => viewer.setVisible("source", isOn)),
      check("show-target", "Target", true, (isOn) => viewer.setVisible("target", isOn)),
      previews.source.distances &&
        check("inliers", "Inliers only", false, (isOn) => viewer.setInliers(isOn ? result.inliers.threshold : null)),
    ),
    h("div", { className: "bar cuts", role: "group", "aria-label": "Section box" }, ...axes),
  );
}

function makeNotes(viewer: Viewer, { source, target }: Previews): HTMLElement {
  const thinned = [source, target].filter(({ count, total }) => count < total);
  const notes = [
    viewer.movedBy > 0 && `Before: the clouds lie far apart in their files; the source is drawn ${short(viewer.movedBy)} ${unitName()} nearer.`,
    thinned.length > 0 && `Drawn: ${source.count.toLocaleString("en")} of ${source.total.toLocaleString("en")} points of the source, ${target.count.toLocaleString("en")} of ${target.total.toLocaleString("en")} of the target.`,
  ].filter(Boolean);
  return h("div", { className: "notes" }, ...notes.map((text) => h("p", { className: "help" }, text || "")));
}
