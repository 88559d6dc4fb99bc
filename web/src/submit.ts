// The form that starts a registration.
import { ApiError, authorization, NO_ANSWER, parseProblem, REGISTRATIONS, type JobSummary } from "./api";
import { makeCloudField, type CloudValue } from "./cloud_field";
import { announce, h } from "./dom";
import { showProblem } from "./faces";
import { makeOptions } from "./options";

const MAX_LABEL_LENGTH = 256;

/** Make the form; it opens the page of the registration once that is accepted. */
export function makeSubmitForm(): HTMLElement {
  const options = makeOptions();
  const button = h("button", { type: "submit", className: "primary", disabled: true }, "Align");
  const refresh = (): void => void (button.disabled = !source.read() || !target.read());
  const source = makeCloudField("source", "Source", "The cloud that is moved.", refresh);
  const target = makeCloudField("target", "Target", "The cloud that stays.", refresh);
  const status = h("div", { className: "submit-status" });
  const form = h(
    "form",
    { className: "card submit", noValidate: true },
    h("div", { className: "pair" }, source.element, target.element),
    options.element,
    h("div", { className: "row" }, button, status),
  );
  form.addEventListener("dragover", (event) => event.preventDefault());
  form.addEventListener("drop", (event) => {
    event.preventDefault();
    const [first, second] = event.dataTransfer?.files ?? [];
    if (first) (second || !source.read() ? source : target).setFile(first);
    if (second) target.setFile(second);
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const [from, to] = [source.read(), target.read()];
    if (!from || !to) return;
    button.disabled = true;
    try {
      const body = makeBody(from, to, options.read());
      const job = await send(body, makeKey(), (share) => showUpload(status, share));
      location.hash = `#/registrations/${job.id}`;
    } catch (error) {
      button.disabled = false;
      status.replaceChildren(showProblem(error));
    }
  });
  return form;
}

function makeBody(source: CloudValue, target: CloudValue, options: Record<string, unknown>): FormData {
  const body = new FormData();
  const labels = { source: source.name.slice(-MAX_LABEL_LENGTH), target: target.name.slice(-MAX_LABEL_LENGTH) };
  body.set("options", JSON.stringify(options));
  body.set("labels", JSON.stringify(labels));
  for (const [role, { content }] of [["source", source], ["target", target]] as const) body.set(role, content);
  return body;
}

/** Send the form; only XMLHttpRequest tells how much has been sent. */
function send(body: FormData, key: string, onSent: (share: number) => void): Promise<JobSummary> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", REGISTRATIONS);
    request.setRequestHeader("Idempotency-Key", key);
    for (const [name, value] of Object.entries(authorization())) request.setRequestHeader(name, value);
    request.upload.addEventListener("progress", ({ loaded, total }) => onSent(loaded / total));
    request.addEventListener("error", () => reject(new ApiError(NO_ANSWER)));
    request.addEventListener("load", () => {
      if (request.status < 300) resolve(JSON.parse(request.responseText) as JobSummary);
      else reject(new ApiError(parseProblem(request.status, request.responseText)));
    });
    request.send(body);
  });
}

function showUpload(status: HTMLElement, share: number): void {
  const text = share < 1 ? `Uploading: ${Math.round(100 * share)} %` : "Uploaded; the service checks the files";
  status.replaceChildren(h("progress", { max: 1, value: share, "aria-label": "Upload" }), h("span", {}, text));
  if (share === 1) announce(text);
}

function makeKey(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}
