// Builders of elements, and figures as text.

type Child = Node | string | null | undefined | false;
type Props = Record<string, string | number | boolean | ((event: Event) => void) | undefined>;

/** Makes an element. A property that is a function listens to an event: `onclick` to `click`. */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Props = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === false) continue;
    if (typeof value === "function") node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else node.setAttribute(name, String(value));
  }
  add(node, ...children);
  return node;
}

export function add(node: Node, ...children: Child[]): void {
  for (const child of children) if (child !== null && child !== undefined && child !== false) node.appendChild(typeof child === "string" ? document.createTextNode(child) : child);
}

export function fill(node: Node, ...children: Child[]): void {
  while (node.firstChild) node.removeChild(node.firstChild);
  add(node, ...children);
}

/** A square of a colour. The script sets the colour, because the service forbids inline styles. */
export function swatch(colour: string, hatched = false): HTMLElement {
  const node = el("span", { class: hatched ? "swatch hatched" : "swatch", "aria-hidden": "true" });
  node.style.setProperty("--colour", colour);
  return node;
}

let serial = 0;

/** An input with its label and hint. */
export function field(label: string, input: HTMLElement, hint?: string): HTMLElement {
  const id = input.id || `f${++serial}`;
  input.id = id;
  const words = hint ? el("small", { id: `${id}h` }, hint) : null;
  if (words) input.setAttribute("aria-describedby", words.id);
  return el("div", { class: "field" }, el("label", { for: id }, label), input, words);
}

export function duration(seconds: number): string {
  const s = Math.max(0, Math.round(seconds));
  const h = Math.floor(s / 3600);
  const m = Math.floor((s % 3600) / 60);
  const two = (v: number): string => String(v).padStart(2, "0");
  return h ? `${h}:${two(m)}:${two(s % 60)}` : `${m}:${two(s % 60)}`;
}

export function figure(value: number | null | undefined, digits: number, unit = ""): string {
  if (value === null || value === undefined) return "–";
  const least = 10 ** -digits;
  const small = value > 0 && value < 0.5 * least; // a small value does not read as zero
  return `${small ? "<\u202f" : ""}${(small ? least : value).toFixed(digits)}${unit ? `\u202f${unit}` : ""}`;
}

/** A share of 0..1, rounded down as on the setup sheet: 100 % means everything. */
export function percent(value: number | null | undefined): string {
  return value === null || value === undefined ? "–" : `${Math.floor(1e4 * value + 1e-9) / 100}\u202f%`;
}
