// The colours of the scene. Those of deviation and tools are the same as in deviation.png and preview.png.

export type RGB = [number, number, number];

export const STEPS = [3, 10]; // multiples of the budget at which a class of deviation ends
export const CLASSES: RGB[] = [
  [0.45, 0.0, 0.1], [0.86, 0.06, 0.06], [1.0, 0.52, 0.32], [0.6, 0.83, 0.56],
  [0.55, 0.78, 1.0], [0.18, 0.48, 0.95], [0.06, 0.14, 0.58],
];
export const UNCUT: RGB = [0.66, 0.66, 0.68];
export const PALE: RGB = [0.87, 0.87, 0.85];
export const CONNECTION: RGB = [1.0, 0.52, 0.0];
export const REMAINDER: RGB = [0.86, 0.1, 0.14];
export const STOCK: RGB = [0.8, 0.72, 0.58];
export const OTHER: RGB = [0.72, 0.73, 0.75];
export const UNNAMED: RGB = [0.82, 0.83, 0.84]; // faces of no wall and no connection
export const REMAINDER_PALE: RGB = [0.98, 0.86, 0.84];
export const RAPID: RGB = [0.35, 0.37, 0.42];
export const REMAINDER_CSS = "#d8191f"; // beside text
export const HIGHLIGHT = 0xe0007a;
const TOOLS: RGB[] = [
  [0.0, 0.33, 0.8], [0.0, 0.5, 0.22], [0.58, 0.1, 0.68], [0.0, 0.48, 0.56], [0.62, 0.36, 0.0],
  [0.8, 0.16, 0.5], [0.25, 0.25, 0.3], [0.36, 0.48, 0.0],
];

export function toolColour(index: number): RGB {
  return TOOLS[index % TOOLS.length]!;
}

function hsl(h: number, s: number, l: number): RGB {
  const f = (n: number): number => {
    const k = (n + h * 12) % 12;
    return l - s * Math.min(l, 1 - l) * Math.max(-1, Math.min(k - 3, 9 - k, 1));
  };
  return [f(0), f(8), f(4)];
}

/** Colour of a zone: neighbours in the list differ, and none is near the red of the remainder or the brown of the stock. */
export function zoneColour(index: number): RGB {
  const hue = 0.15 + 0.76 * ((index * 0.381966) % 1);
  return hsl(hue, [0.52, 0.42, 0.62][index % 3]!, [0.62, 0.5, 0.72][Math.floor(index / 2) % 3]!);
}

export function wallColour(index: number): RGB {
  return hsl(0.28 + 0.5 * ((index * 0.381966) % 1), [0.4, 0.3, 0.5][index % 3]!, [0.6, 0.7, 0.5][index % 3]!);
}

export function css([r, g, b]: RGB): string {
  return `rgb(${Math.round(255 * r)} ${Math.round(255 * g)} ${Math.round(255 * b)})`;
}
