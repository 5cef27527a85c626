// What a browser keeps for a page. One that is told to keep nothing throws at the mere look, and the page goes on without.

type Shelf = "localStorage" | "sessionStorage";
const here = new Map<string, string>();

export function kept(shelf: Shelf, key: string): string | null {
  try {
    return window[shelf].getItem(key);
  } catch {
    return here.get(`${shelf} ${key}`) ?? null;
  }
}

/** Keeps a value; null forgets it. */
export function keep(shelf: Shelf, key: string, value: string | null): void {
  try {
    if (value === null) window[shelf].removeItem(key);
    else window[shelf].setItem(key, value);
  } catch {
    if (value === null) here.delete(`${shelf} ${key}`);
    else here.set(`${shelf} ${key}`, value);
  }
}
