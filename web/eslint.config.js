import { defineConfig } from "eslint/config";
import tseslint from "typescript-eslint";

export default defineConfig(
  { ignores: ["dist/", "node_modules/", "src/api.gen.ts"] },
  ...tseslint.configs.strictTypeChecked,
  ...tseslint.configs.stylisticTypeChecked,
  {
    languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: import.meta.dirname } },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      "@typescript-eslint/switch-exhaustiveness-check": "error",
      "@typescript-eslint/prefer-nullish-coalescing": "error",
      "no-restricted-syntax": [
        "error",
        { selector: "CallExpression[callee.object.name='Date'][callee.property.name='now']", message: "take the time as a parameter" },
        { selector: "NewExpression[callee.name='Date'][arguments.length=0]", message: "take the time as a parameter" },
        { selector: "CallExpression[callee.object.name='Math'][callee.property.name='random']", message: "take chance as a parameter" },
      ],
      eqeqeq: ["error", "always", { null: "ignore" }],
      "@typescript-eslint/no-confusing-void-expression": ["error", { ignoreArrowShorthand: true, ignoreVoidReturningFunctions: true }],
      "no-console": "error",
    },
  },
  {
    // Programs: they print, and read the clock.
    files: ["test/mock/*.mjs", "e2e/*.mjs", "scripts/*.mjs", "src/main.ts"],
    rules: { "no-console": "off", "no-restricted-syntax": "off" },
  },
);
