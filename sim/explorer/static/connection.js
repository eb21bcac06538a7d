// Requests to the server. The token of the page is kept here and in no address.

let token = "";

/** Keep a text for a reload in this tab, if there is a storage with room for it; a frame may have none.
 * @param {string} name
 * @param {string} text */
function keep(name, text) {
  try {
    sessionStorage.setItem(name, text);
  } catch {
    // nothing is kept
  }
}

/** @param {string} name */
function kept(name) {
  try {
    return sessionStorage.getItem(name);
  } catch {
    return null;
  }
}

/** Take the token of an address, or the one of an earlier visit in this tab. Return false if there is none.
 * @param {URLSearchParams} address */
export function authorised(address) {
  token = address.get("token") ?? kept("token") ?? token;
  keep("token", token);
  return token !== "";
}

/** Return the address of this page for another tab of this machine.
 * @param {string} words */
export const shareable = (words) => `${location.origin}/#token=${token}${words ? `&${words}` : ""}`;

/** Keep something for a reload in this tab.
 * @param {any} content */
export const store = (content) => keep("page", JSON.stringify({ token, content }));

/** Return what was kept for a reload, if it belongs to this server.
 * @returns {any} */
export function stored() {
  const found = JSON.parse(kept("page") ?? "null");
  return found?.token === token ? found.content : null;
}

/** @param {string} path
 * @param {any} request
 * @param {AbortSignal | null} signal */
async function post(path, request, signal = null) {
  const headers = { "content-type": "application/json", "x-token": token };
  try {
    return await fetch(`/${path}`, { method: "POST", headers, body: JSON.stringify(request), signal });
  } catch (fault) {
    if (signal?.aborted) throw fault;
    throw new Error("The server has ended. Run sim explore again.");
  }
}

/** Return the server's answer to a request.
 * @param {string} path
 * @param {any} request
 * @returns {Promise<any>} */
export async function ask(path, request) {
  const response = await post(path, request);
  const answer = await response.json();
  if (!response.ok) throw new Error(answer.message);
  return answer;
}

/** Run a job, whose stream of messages is the job: it ends with its reader.
 * @param {any} request
 * @param {AbortSignal} signal
 * @param {(message: any) => void} take */
export async function stream(request, signal, take) {
  const response = await post("run", request, signal);
  if (!response.headers.get("content-type")?.includes("ndjson")) {
    const { message, faults } = await response.json();
    throw new Error(message ?? Object.values(faults).join("; "));
  }
  const body = /** @type {ReadableStream<BufferSource>} */ (/** @type {unknown} */ (response.body));
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  for (let text = ""; ;) {
    const { value, done } = await reader.read();
    if (done) return;
    const lines = (text + value).split("\n");
    text = lines.pop() ?? "";
    lines.map((line) => JSON.parse(line)).forEach(take);
  }
}
