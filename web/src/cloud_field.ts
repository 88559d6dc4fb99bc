// One cloud of a submission: a file that is dropped or picked, an address, or a stored cloud.
import { h } from "./dom";

export interface CloudValue {
  content: File | string;
  /** Name for people. */
  name: string;
}

type Kind = "file" | "url" | "cloud";

const UNITS = ["B", "kB", "MB", "GB", "TB"];

/** Make the field of a role; `read` gives what was chosen, or null. */
export function makeCloudField(
  role: "source" | "target",
  title: string,
  explanation: string,
  onChange: () => void,
): { element: HTMLElement; read: () => CloudValue | null; setFile: (file: File) => void } {
  let [kind, file]: [Kind, File | null] = ["file", null];
  const picker = h("input", { type: "file", id: `${role}-file`, className: "hidden-file" });
  const chosen = h("span", { className: "chosen", id: `${role}-chosen` }, "Drop a file or a link here, or pick a file");
  const zone = h("label", { className: `zone ${role}`, htmlFor: `${role}-file` }, picker, h("strong", {}, title), chosen);
  const text = h("input", { type: "text", id: `${role}-text`, autocomplete: "off", spellcheck: false, oninput: onChange });
  const textLabel = h("label", { htmlFor: `${role}-text` });
  const typed = h("div", { className: `zone typed ${role}`, hidden: true }, h("strong", {}, title), textLabel, text);

  const setFile = (given: File): void => {
    file = given;
    chosen.replaceChildren(h("b", {}, given.name), ` ${formatBytes(given.size)}`);
    zone.classList.add("filled");
    onChange();
  };
  picker.addEventListener("change", () => picker.files?.[0] && setFile(picker.files[0]));
  for (const name of ["dragover", "dragenter"]) {
    zone.addEventListener(name, (event) => {
      event.preventDefault();
      zone.classList.add("over");
    });
  }
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => {
    zone.classList.remove("over");
    event.preventDefault();
    event.stopPropagation();
    const dropped = event.dataTransfer?.files[0];
    const address = event.dataTransfer?.getData("text/uri-list").split("\n").find((line) => !line.startsWith("#"));
    if (dropped) setFile(dropped);
    else if (address) setAddress(address.trim());
  });
  const choice = h(
    "select",
    { id: `${role}-kind`, "aria-label": `Where the ${role} comes from`, className: "small" },
    h("option", { value: "file" }, "File"),
    h("option", { value: "url" }, "URL"),
    h("option", { value: "cloud" }, "Stored cloud"),
  );
  choice.addEventListener("change", () => {
    kind = choice.value as Kind;
    zone.hidden = kind !== "file";
    typed.hidden = kind === "file";
    textLabel.textContent = kind === "url" ? "http(s) or s3 address" : "Id of the stored cloud";
    onChange();
  });
  const setAddress = (address: string): void => {
    choice.value = "url";
    text.value = address;
    choice.dispatchEvent(new Event("change"));
  };
  const element = h(
    "div",
    { className: "cloud-field" },
    zone,
    typed,
    h("div", { className: "under" }, h("span", { className: "help" }, explanation), choice),
  );
  const read = (): CloudValue | null => {
    if (kind === "file") return file && { content: file, name: file.name };
    const value = text.value.trim();
    return value ? { content: JSON.stringify({ [kind]: value }), name: value.split(/[/?]/).filter(Boolean).pop() ?? value } : null;
  };
  return { element, read, setFile };
}

export function formatBytes(size: number): string {
  const power = size < 1 ? 0 : Math.min(UNITS.length - 1, Math.floor(Math.log10(size) / 3));
  return `${(size / 1000 ** power).toLocaleString("en", { maximumSignificantDigits: 3 })} ${UNITS[power]}`;
}
