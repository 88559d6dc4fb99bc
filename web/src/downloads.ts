// Files to save, and the lines that do the same from a shell or from Python.
import { download, getKey, REGISTRATIONS, type Job } from "./api";
import { copyable, h } from "./dom";
import { isDefault } from "./options";
import { showProblem } from "./faces";
import { unitQuery } from "./unit";

export const FORMATS = ["ply", "pcd", "las", "laz", "e57", "npy", "xyz", "csv", "obj", "stl", "glb"];

export function makeDownloads(job: Job): HTMLElement {
  const path = `${REGISTRATIONS}/${job.id}`;
  const status = h("div");
  const format = h("select", { id: "format" }, ...FORMATS.map((name) => h("option", { value: name }, name.toUpperCase())));
  const merged = h("input", { type: "checkbox", id: "merged" });
  const distances = h("input", { type: "checkbox", id: "distances" });
  const save = (text: string, what: () => [string, string]): HTMLElement => {
    const button = h("button", { type: "button" }, text);
    button.addEventListener("click", async () => {
      button.disabled = true;
      status.replaceChildren();
      try {
        await download(...what());
      } catch (error) {
        status.replaceChildren(showProblem(error));
      }
      button.disabled = false;
    });
    return button;
  };
  return h(
    "section",
    { className: "card" },
    h("h2", {}, "Files"),
    h(
      "div",
      { className: "row" },
      h("label", { htmlFor: "format" }, "Aligned source as"),
      format,
      h("span", { className: "group" }, merged, h("label", { htmlFor: "merged" }, "with the target")),
      h("span", { className: "group" }, distances, h("label", { htmlFor: "distances" }, "with distances")),
      save("Download", () => [
        `${path}/aligned?format=${format.value}&merged=${merged.checked}&distances=${distances.checked}`,
        `${merged.checked ? "merged" : "aligned"}-${job.id.slice(0, 8)}.${format.value}`,
      ]),
    ),
    h(
      "div",
      { className: "row" },
      save("Report (HTML)", () => [`${path}/report${unitQuery()}`, `report-${job.id.slice(0, 8)}.html`]),
      save("Picture (PNG)", () => [`${path}/preview.png`, `registration-${job.id.slice(0, 8)}.png`]),
      save("Result (JSON)", () => [path, `registration-${job.id.slice(0, 8)}.json`]),
      save("Statistics of distances (JSON)", () => [`${path}/deviation`, `deviation-${job.id.slice(0, 8)}.json`]),
      save("Inlier pairs (NPY)", () => [`${path}/inliers?format=npy`, `inliers-${job.id.slice(0, 8)}.npy`]),
    ),
    status,
    h("h3", {}, "The same with curl"),
    copyable(writeCurl(job, path), "curl lines"),
    h("h3", {}, "The same in Python"),
    copyable(writePython(job), "Python lines"),
  );
}

function givenOptions(job: Job): [string, unknown][] {
  return Object.entries(job.options).filter(([name, value]) => !isDefault(name, value));
}

function writeCurl(job: Job, path: string): string {
  const { origin } = location;
  const key = getKey() ? ` \\\n    -H "Authorization: Bearer $MPE_CLIENT_KEY"` : "";
  const given = Object.fromEntries(givenOptions(job));
  const options = Object.keys(given).length ? ` \\\n    -F ${quote(`options=${JSON.stringify(given)}`)}` : "";
  const [source, target] = (["source", "target"] as const).map((role) => writeCloud(job, role));
  return [
    `curl -sS -H 'Prefer: wait=60'${key} \\\n    -F ${source} -F ${target}${options} \\\n    ${origin}${REGISTRATIONS}`,
    `curl -sS${key.replace(" \\\n   ", "")} "${origin}${path}/aligned?format=ply" -o aligned.ply`,
  ].join("\n");
}

function writeCloud(job: Job, role: "source" | "target"): string {
  const { url, cloud } = job[role];
  if (cloud) return quote(`${role}={"cloud": ${JSON.stringify(cloud)}}`);
  if (url) return quote(`${role}={"url": ${JSON.stringify(url)}}`);
  return quote(`${role}=@${job.labels[role] ?? `${role}.ply`}`);
}

function quote(text: string): string {
  return /^[\w@=.,/:-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

function writePython(job: Job): string {
  const [source, target] = (["source", "target"] as const).map((role) => {
    const { url, cloud } = job[role];
    return cloud ? `StoredCloud(${JSON.stringify(cloud)})` : JSON.stringify(url ?? job.labels[role] ?? `${role}.ply`);
  });
  const options = givenOptions(job).map(([name, value]) => `${name}=${value === true ? "True" : JSON.stringify(value)}`);
  const stored = job.source.cloud || job.target.cloud ? ", StoredCloud" : "";
  return [
    `from mpe_client import align${stored}`,
    "",
    `job = align(${[source, target, `url=${JSON.stringify(location.origin)}`, ...options].join(", ")})`,
    "print(job.result.transform, job.result.confidence)",
  ].join("\n");
}
