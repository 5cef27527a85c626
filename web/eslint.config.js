import js from "@eslint/js";
import { defineConfig } from "eslint/config";
import tseslint from "typescript-eslint";

// What the drivers of the page (tests/*.mjs) take from Node and from the browser.
const names = ["Blob", "Buffer", "DOMException", "DataView", "Event", "HTMLCanvasElement", "TextEncoder", "URL", "console", "document", "fetch",
  "getComputedStyle", "history", "innerWidth", "localStorage", "location", "navigator", "performance", "process", "sessionStorage", "setTimeout", "window"];

export default defineConfig(
  { ignores: ["node_modules", "src/wire.ts"] },
  { linterOptions: { reportUnusedDisableDirectives: "error" } },
  js.configs.recommended,
  {
    rules: {
      "eqeqeq": "error",
      "no-console": "error",
      "no-eval": "error",
      "no-var": "error",
      "prefer-const": ["error", { destructuring: "all" }],
    },
  },
  {
    files: ["src/**/*.ts"],
    extends: [tseslint.configs.recommendedTypeChecked, tseslint.configs.stylisticTypeChecked],
    languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: import.meta.dirname } },
    rules: {
      // arrays are indexed within their length (noUncheckedIndexedAccess asks for the mark)
      "@typescript-eslint/no-non-null-assertion": "off",
      "@typescript-eslint/consistent-type-imports": "error",
      "@typescript-eslint/explicit-function-return-type": ["error", { allowExpressions: true }],
      "@typescript-eslint/no-empty-function": "off",
      "@typescript-eslint/prefer-readonly": "error",
      "@typescript-eslint/switch-exhaustiveness-check": "error",
      "complexity": ["error", 20],
      "max-depth": ["error", 5],
      "max-len": ["error", { code: 200 }],
      "max-lines": ["error", 350],
      "max-lines-per-function": ["error", 80],
      "max-params": ["error", 10],
    },
  },
  { files: ["tests/*.mjs"], languageOptions: { globals: Object.fromEntries(names.map((name) => [name, "readonly"])) }, rules: { "no-console": "off" } },
);
