// Values that the browser stores for the page. Where the browser allows no storage, they last until the page is closed.

type Shelf = "localStorage" | "sessionStorage";
const fallback = new Map<string, string>();

export function stored(shelf: Shelf, key: string): string | null {
  try {
    return window[shelf].getItem(key);
  } catch {
    return fallback.get(`${shelf} ${key}`) ?? null;
  }
}

/** Stores a value; null removes it. */
export function store(shelf: Shelf, key: string, value: string | null): void {
  try {
    if (value === null) window[shelf].removeItem(key);
    else window[shelf].setItem(key, value);
  } catch {
    if (value === null) fallback.delete(`${shelf} ${key}`);
    else fallback.set(`${shelf} ${key}`, value);
  }
}
