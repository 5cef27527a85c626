// What every page has: its head, its theme, the field for a key, and words for what was refused.
import { Refusal, hasKey, useKey } from "./api";
import { el, fill } from "./dom";
import { keep, kept } from "./browser-storage";

export type Theme = "auto" | "light" | "dark";
const THEME = "zonemill-theme";

export function theme(): Theme {
  const chosen = kept("localStorage", THEME);
  return chosen === "light" || chosen === "dark" ? chosen : "auto";
}

export function isDark(): boolean {
  const t = theme();
  return t === "dark" || (t === "auto" && matchMedia("(prefers-color-scheme: dark)").matches);
}

const listeners = new Set<() => void>();

export function onTheme(listener: () => void): void {
  listeners.add(listener);
}

function apply(): void {
  document.documentElement.dataset.theme = isDark() ? "dark" : "light";
  listeners.forEach((l) => l());
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
apply();

export function colourOf(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** The head of a page; `more` stands at its right end. */
export function head(title: Node, ...more: Node[]): HTMLElement {
  const button = el("button", { type: "button", class: "quiet", onclick: () => {
    keep("localStorage", THEME, isDark() ? "light" : "dark");
    apply();
    name();
  } });
  const name = (): void => {
    button.textContent = isDark() ? "Light" : "Dark";
    button.setAttribute("aria-label", isDark() ? "Use light colours" : "Use dark colours");
  };
  name();
  return el("header", { class: "top" }, el("a", { href: "/", class: "home" }, "zonemill"), title, el("div", { class: "spring" }), ...more, button);
}

export function reducedMotion(): boolean {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

/** Says what went wrong, and asks for a key where that is what is missing. */
export function showRefusal(place: HTMLElement, error: unknown, again: () => void): void {
  if (error instanceof Refusal && (error.status === 401 || (error.status === 403 && error.problem.code !== "foreign_page"))) {
    fill(place, keyForm(error, again));
    return;
  }
  const problem = error instanceof Refusal ? error.problem : {};
  fill(place, el("div", { class: "refusal", role: "alert" },
    el("h2", {}, problem.title ?? "That did not work"),
    el("p", {}, error instanceof Error ? error.message : String(error)),
    problem.remedy ? el("p", {}, el("strong", {}, "What to do: "), problem.remedy) : null,
    el("p", { class: "buttons" }, el("button", { type: "button", onclick: again }, "Try again"),
      // a job of another key is none to this one
      error instanceof Refusal && error.status === 404 && hasKey() ? el("button", { type: "button", onclick: () => fill(place, keyForm(error, again)) }, "Use another key") : null)));
}

function keyForm(error: Refusal, again: () => void): HTMLElement {
  const input = el("input", { type: "password", id: "key", autocomplete: "off", required: true });
  const wrong = el("p", { class: "bad", role: "alert" });
  return el("form", { class: "refusal", onsubmit: (event: Event) => {
    event.preventDefault();
    const key = input.value.trim();
    // a header takes nothing else, and what was copied from a message often has more in it than is seen
    if (!/^[\x21-\x7e]+$/.test(key)) {
      wrong.textContent = "A key is of plain letters, figures and underscores, without spaces. Copy it once more.";
      return;
    }
    useKey(key);
    again();
  } },
    el("h2", {}, "This service asks for a key"),
    el("p", {}, hasKey() ? error.message : "Its operator makes one with: zonemill keys create. It is kept in this tab only, and forgotten with it."),
    el("label", { for: "key" }, "Key"), input, wrong, el("button", { type: "submit", class: "main" }, "Use it"));
}
