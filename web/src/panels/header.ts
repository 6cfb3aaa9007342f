// The bar above the map: which level, how fresh, who.

import { el, setShown, setText } from "../dom";
import type { State } from "../state";
import type { Store } from "../store";
import type { SessionDescription } from "../wire";
import { ago, count } from "../words";

export interface HeaderOptions {
  parent: HTMLElement;
  store: Store;
  onSignOut: () => void;
}

interface Choice {
  value: string;
  title: string;
}

function drawChoices(select: HTMLSelectElement, choices: readonly Choice[], chosen: string | null): void {
  const wanted = JSON.stringify(choices);
  if (select.dataset["choices"] !== wanted) {
    select.dataset["choices"] = wanted;
    select.replaceChildren(...choices.map(({ value, title }) => el("option", { text: title, attrs: { value } })));
  }
  if (select.value !== (chosen ?? "")) select.value = chosen ?? "";
  select.disabled = choices.length === 0;
}

export function createHeader({ parent, store, onSignOut }: HeaderOptions): (state: State) => void {
  const site = el("select", {
    attrs: { id: "site" },
    on: {
      change: () => {
        const chosen = store.state().sites?.find((one) => one.site === site.value);
        const level = chosen?.levels.at(0);
        store.dispatch({
          kind: "place",
          place: chosen === undefined || level === undefined ? null : { site: chosen.site, level },
        });
      },
    },
  });
  const level = el("select", {
    attrs: { id: "level" },
    on: {
      change: () => {
        const { place } = store.state();
        if (place !== null) store.dispatch({ kind: "place", place: { site: place.site, level: level.value } });
      },
    },
  });
  const revision = el("span", { class: "revision" });
  const link = el("span", { class: "link", attrs: { role: "status" } });
  const who = el("span", { class: "who" });
  const panels = el("button", {
    class: "panels-toggle",
    text: "Panels",
    attrs: { type: "button", "aria-controls": "panels" },
    on: {
      click: () => {
        store.dispatch({ kind: "panels", open: !store.state().panelsOpen });
      },
    },
  });
  parent.append(
    el("span", { class: "brand", text: "Mapfold" }),
    el("label", { class: "chooser" }, el("span", { text: "Site" }), site),
    el("label", { class: "chooser" }, el("span", { text: "Level" }), level),
    el("span", { class: "spacer" }),
    revision,
    link,
    who,
    el("button", { class: "quiet", text: "Sign out", attrs: { type: "button" }, on: { click: onSignOut } }),
    panels,
  );

  return (state) => {
    const sites = (state.sites ?? []).filter((one) => one.levels.length > 0);
    drawChoices(site, sites.map((one) => ({ value: one.site, title: one.name })), state.place?.site ?? null);
    const levels = sites.find((one) => one.site === state.place?.site)?.levels ?? [];
    drawChoices(level, levels.map((slug) => ({ value: slug, title: slug })), state.place?.level ?? null);

    const heading = state.level === null ? "Mapfold" : `${state.level.name} · Mapfold`;
    if (document.title !== heading) document.title = heading;
    setShown(revision, state.level !== null);
    setText(revision, `Revision ${count(state.content.vectorRevision)}`);
    const { word, title } = linkInWords(state);
    link.dataset["link"] = state.link.kind;
    setText(link, word);
    if (link.title !== title) link.title = title;
    setText(who, state.session.kind === "in" ? whoInWords(state.session.who) : "");
    panels.setAttribute("aria-expanded", String(state.panelsOpen));
  };
}

function whoInWords({ scopes, site, robot }: SessionDescription): string {
  if (robot != null) return robot;
  const role = scopes.includes("admin") ? "admin" : scopes.includes("map:edit") ? "editor" : "reader";
  return site == null ? role : `${role} of ${site}`;
}

function linkInWords({ link, nowMs }: State): { word: string; title: string } {
  switch (link.kind) {
    case "idle":
      return { word: "Idle", title: "No level is followed." };
    case "connecting":
      return { word: "Connecting", title: "Opening the live stream." };
    case "live":
      return { word: "Live", title: "Changes show by themselves." };
    case "lost":
      return { word: "Offline", title: `Without contact since ${ago(link.sinceMs, nowMs)}. ${link.problem}` };
  }
}
