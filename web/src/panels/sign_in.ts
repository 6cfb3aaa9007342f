// The way in: a token, or what keeps the page from asking for one.

import { el, setShown, setText } from "../dom";
import type { State } from "../state";

export interface SignInOptions {
  parent: HTMLElement;
  onSignIn: (token: string) => void;
  onRetry: () => void;
}

export function createSignIn({ parent, onSignIn, onRetry }: SignInOptions): (state: State) => void {
  const token = el("input", {
    attrs: {
      id: "token",
      type: "password",
      name: "token",
      autocomplete: "current-password",
      spellcheck: "false",
      required: "",
      "aria-describedby": "sign-in-problem",
    },
  });
  const submit = el("button", { class: "primary", text: "Sign in", attrs: { type: "submit" } });
  const problem = el("p", { class: "problem", attrs: { id: "sign-in-problem", role: "alert" } });
  const form = el(
    "form",
    {
      on: {
        submit: (event) => {
          event.preventDefault();
          const value = token.value.trim();
          if (value !== "") onSignIn(value);
        },
      },
    },
    // For password managers, which file a secret under a name.
    el("input", { attrs: { type: "text", name: "username", autocomplete: "username", value: "mapfold", hidden: "" } }),
    el("label", { text: "Access token", attrs: { for: "token" } }),
    token,
    problem,
    submit,
    el("p", {
      class: "hint",
      text: "The server printed an admin token when it was first started. More are made with “mapfold-server token create”.",
    }),
  );
  const retry = el("button", { class: "primary", text: "Try again", attrs: { type: "button" }, on: { click: onRetry } });
  const trouble = el("p", { class: "problem", attrs: { role: "alert" } });
  const unreachable = el("div", {}, trouble, retry);
  const screen = el(
    "div",
    { class: "sign-in" },
    el("div", { class: "card" }, el("h1", { text: "Mapfold" }), el("p", { class: "lead", text: "One map, drawn by every robot of the fleet." }), form, unreachable),
  );
  parent.append(screen);

  let focused = false;
  return ({ session }) => {
    const asks = session.kind === "out" || session.kind === "signing-in";
    setShown(screen, asks || session.kind === "unreachable");
    setShown(form, asks);
    setShown(unreachable, session.kind === "unreachable");
    setText(trouble, session.kind === "unreachable" ? session.problem : "");
    setText(problem, session.kind === "out" ? (session.problem ?? "") : "");
    submit.disabled = session.kind === "signing-in";
    setText(submit, session.kind === "signing-in" ? "Signing in …" : "Sign in");
    if (session.kind === "in") token.value = "";
    if (asks && !focused) token.focus();
    focused = asks;
  };
}
