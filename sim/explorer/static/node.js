// Elements as plain objects, so that they can be drawn, saved and tested alike. The page is brought to them.

/** @typedef {{ tag: string, attributes: Record<string, string | number | boolean>, children: (Node | string)[] }} Node */

const SVG = "http://www.w3.org/2000/svg";

/** Return a description of an element. Its booleans and its `value` are properties of the element.
 * @param {string} tag
 * @param {Node["attributes"]} attributes
 * @param {(Node | string)[]} children
 * @returns {Node} */
export const h = (tag, attributes = {}, ...children) => ({ tag, attributes, children });

/** Return an element of the page by its name.
 * @param {string} id
 * @returns {any} */
export const $ = (id) => document.getElementById(id);

/** The nodes to which elements were brought.
 * @type {WeakMap<Element, Node>} */
const brought = new WeakMap();

/** Bring an element to a node. Only what differs from its last node is written, so that a browser styles, lays out and
 * paints no more than that. Properties are compared with the element itself, because a reader changes them, too.
 * @param {any} item
 * @param {Node} node */
export function bring(item, node) {
  const before = brought.get(item) ?? h(node.tag);
  brought.set(item, node);
  for (const name of Object.keys({ ...before.attributes, ...node.attributes })) {
    const value = node.attributes[name];
    if (typeof value === "boolean" || name === "value") {
      if (item[name] !== value) item[name] = value;
    } else if (value === undefined) item.removeAttribute(name);
    else if (value !== before.attributes[name]) item.setAttribute(name, value);
  }
  for (const [place, child] of node.children.entries()) {
    const [last, old] = [before.children[place], item.childNodes[place]];
    if (child === last) continue;
    if (typeof child === "string" && typeof last === "string") old.data = child;
    else if (typeof child === "object" && child.tag === /** @type {any} */ (last)?.tag) bring(old, child);
    else if (old) old.replaceWith(built(child, item.namespaceURI));
    else item.append(built(child, item.namespaceURI));
  }
  for (let count = before.children.length; count > node.children.length; count -= 1)
    item.childNodes[count - 1].remove();
}

/** Return a node as an element or a text.
 * @param {Node | string} node
 * @param {string} space name space of its parent */
function built(node, space) {
  if (typeof node === "string") return document.createTextNode(node);
  const result = document.createElementNS(node.tag === "svg" ? SVG : space, node.tag);
  bring(result, node);
  return result;
}

/** Bring an element that the page has from the start to attributes, and to a content if one is given.
 * @param {string} id
 * @param {Node["attributes"]} attributes
 * @param {(Node | string)[]} children */
export function put(id, attributes, ...children) {
  bring($(id), h("", attributes, ...children));
}

/** Return a node as the text of a file.
 * @param {Node | string} node
 * @returns {string} */
export function written(node) {
  const plain = (/** @type {string} */ text) =>
    text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll('"', "&quot;");
  if (typeof node === "string") return plain(node);
  const words = Object.entries(node.attributes).map(([name, value]) => ` ${name}="${plain(String(value))}"`);
  return `<${node.tag}${words.join("")}>${node.children.map(written).join("")}</${node.tag}>`;
}
