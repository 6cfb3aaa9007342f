// Making and keeping DOM elements with as little ceremony as possible. Text only ever goes in as
// text.

export interface ElementOptions {
  class?: string;
  text?: string;
  attrs?: Readonly<Record<string, string>>;
  on?: Readonly<Partial<{ [K in keyof HTMLElementEventMap]: (event: HTMLElementEventMap[K]) => void }>>;
}

/** A new element. */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  options: ElementOptions = {},
  ...children: readonly (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (options.class !== undefined) element.className = options.class;
  if (options.text !== undefined) element.textContent = options.text;
  for (const [name, value] of Object.entries(options.attrs ?? {})) element.setAttribute(name, value);
  for (const [type, listener] of Object.entries(options.on ?? {})) {
    element.addEventListener(type, listener as EventListener);
  }
  element.append(...children);
  return element;
}

/** The head of a card that folds. It only asks for a turn: the browser tells of one it made by itself a moment later, and a
 * frame drawn in between would take it back. */
export function foldingHead(title: string, turn: () => void): HTMLElement {
  const click = (event: Event): void => {
    event.preventDefault();
    turn();
  };
  return el("summary", { on: { click } }, el("h2", { text: title }));
}

/** Sets an element's text, if it is another. */
export function setText(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** Shows or hides an element. */
export function setShown(element: HTMLElement, shown: boolean): void {
  if (element.hidden === shown) element.hidden = !shown;
}

/** What `keyed` keeps for each item. */
export interface Row<T> {
  element: HTMLElement;
  draw: (item: T) => void;
}

/**
 * Draws a list into `parent`: elements of items that stay are kept (with focus and scroll), in the
 * order of the items.
 */
export function keyed<T>(
  parent: HTMLElement,
  options: { key: (item: T) => string; make: (item: T) => Row<T> },
): (items: readonly T[]) => void {
  let rows = new Map<string, Row<T>>();
  return (items) => {
    const next = new Map<string, Row<T>>();
    let place = parent.firstElementChild;
    for (const item of items) {
      const key = options.key(item);
      const row = rows.get(key) ?? options.make(item);
      next.set(key, row);
      row.draw(item);
      if (row.element === place) place = place.nextElementSibling;
      else parent.insertBefore(row.element, place);
    }
    for (const [key, row] of rows) if (!next.has(key)) row.element.remove();
    rows = next;
  };
}

/** A line of a log that never changes: what was done, and by whom. */
export function logRow<T>(what: string, whose: string): Row<T> {
  const element = el("li", {}, el("span", { class: "name", text: what }), el("span", { class: "what", text: whose }));
  return { element, draw: () => undefined };
}

/** A small swatch of a line as the map draws it. */
export function swatch(): { element: SVGSVGElement; draw: (stroke: { colour: string; dash: readonly number[] }) => void } {
  const space = "http://www.w3.org/2000/svg";
  const element = document.createElementNS(space, "svg");
  element.setAttribute("class", "swatch");
  element.setAttribute("viewBox", "0 0 22 10");
  element.setAttribute("aria-hidden", "true");
  const line = document.createElementNS(space, "line");
  for (const [name, value] of [["x1", "1"], ["x2", "21"], ["y1", "5"], ["y2", "5"], ["stroke-width", "4"]] as const) {
    line.setAttribute(name, value);
  }
  element.append(line);
  return {
    element,
    draw({ colour, dash }) {
      line.setAttribute("stroke", colour);
      line.setAttribute("stroke-dasharray", dash.join(" "));
    },
  };
}
