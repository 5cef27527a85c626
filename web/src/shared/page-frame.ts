// The frame of every page: its header, its theme, errors, and the form for a key.
import { RequestError, hasKey, useKey } from "./api";
import { el, fill } from "./dom";
import { store, stored } from "./browser-storage";

export type Theme = "auto" | "light" | "dark";
const THEME = "zonemill-theme";

export function theme(): Theme {
  const chosen = stored("localStorage", THEME);
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

/** The value of a colour variable of the style sheet. */
export function themeColour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export function pageHeader(title: Node): HTMLElement {
  const button = el("button", { type: "button", class: "quiet", onclick: () => {
    store("localStorage", THEME, isDark() ? "light" : "dark");
    apply();
    name();
  } });
  const name = (): void => {
    button.textContent = isDark() ? "Light" : "Dark";
    button.setAttribute("aria-label", isDark() ? "Use light colours" : "Use dark colours");
  };
  name();
  return el("header", { class: "top" }, el("a", { href: "/", class: "home" }, "zonemill"), title, el("div", { class: "spring" }), button);
}

export function reducedMotion(): boolean {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

/** Shows an error with its remedy, or the form for a key where the key is missing. */
export function showError(place: HTMLElement, error: unknown, again: () => void): void {
  if (error instanceof RequestError && (error.status === 401 || (error.status === 403 && error.problem.code !== "foreign_page"))) {
    fill(place, keyForm(error, again));
    return;
  }
  const problem = error instanceof RequestError ? error.problem : {};
  fill(place, el("div", { class: "refusal", role: "alert" },
    el("h2", {}, problem.title ?? "The request failed"),
    el("p", {}, error instanceof Error ? error.message : String(error)),
    problem.remedy ? el("p", {}, el("strong", {}, "Remedy: "), problem.remedy) : null,
    el("p", { class: "buttons" }, el("button", { type: "button", onclick: again }, "Try again"),
      // a key does not see the jobs of other keys
      error instanceof RequestError && error.status === 404 && hasKey() ? el("button", { type: "button", onclick: () => fill(place, keyForm(error, again)) }, "Use another key") : null)));
}

function keyForm(error: RequestError, again: () => void): HTMLElement {
  const input = el("input", { type: "password", id: "key", autocomplete: "off", required: true });
  const wrong = el("p", { class: "bad", role: "alert" });
  return el("form", { class: "refusal", onsubmit: (event: Event) => {
    event.preventDefault();
    const key = input.value.trim();
    // a header takes nothing else, and a key copied from a message often contains invisible characters
    if (!/^[\x21-\x7e]+$/.test(key)) {
      wrong.textContent = "A key consists of letters, digits and underscores, without spaces. Copy it again.";
      return;
    }
    useKey(key);
    again();
  } },
    el("h2", {}, "This service needs a key"),
    el("p", {}, hasKey() ? error.message : "The operator creates a key with: zonemill keys create. The key is stored in this tab until the tab is closed."),
    el("label", { for: "key" }, "Key"), input, wrong, el("button", { type: "submit", class: "main" }, "Use key"));
}
