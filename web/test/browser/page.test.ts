// The built page in Chromium, against a made-up server.

import type { Browser, Page } from "playwright-core";
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, it } from "vitest";
import { launchBrowser } from "../../e2e/browser.mjs";
import { LIGHT } from "../../src/palette";
import { createMockServer, MOCK_TOKEN } from "../mock/server.mjs";

type Mock = ReturnType<typeof createMockServer>;

let browser: Browser;
let mock: Mock;
let origin: string;
let page: Page;
/** What a browser complains about: script errors, console errors, refusals by the page's policy. */
let complaints: string[];
/** Requests that left this machine. */
let strays: string[];

beforeAll(async () => {
  browser = await launchBrowser();
});
afterAll(async () => {
  await browser.close();
});
beforeEach(async () => {
  mock = createMockServer();
  origin = await mock.listen();
  mock.step(12);
});
afterEach(async () => {
  await page.context().close();
  await mock.close();
});

async function open(hash: string, options: { width?: number; height?: number } = {}): Promise<void> {
  const context = await browser.newContext({ viewport: { width: options.width ?? 1280, height: options.height ?? 800 } });
  page = await context.newPage();
  complaints = [];
  strays = [];
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") complaints.push(message.text());
  });
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("request", (request) => {
    if (!request.url().startsWith(origin) && !request.url().startsWith("blob:")) strays.push(request.url());
  });
  await page.goto(`${origin}/${hash}`);
}

const SIGNED_IN = `#token=${MOCK_TOKEN}`;

/** A fact of the root element's `data-` attributes. */
async function fact(name: string): Promise<string | undefined> {
  return page.evaluate((key) => document.documentElement.dataset[key], name);
}

async function until(name: string, value: string | number): Promise<void> {
  await page.waitForFunction(([key, wanted]) => document.documentElement.dataset[key] === wanted, [name, String(value)] as const);
}

/** The page shows all that the server has. */
async function caughtUp(): Promise<void> {
  await until("revision", mock.ground.revision());
  await until("tilesPending", 0);
}

/** Pixels of a layer's canvas that have about this colour. */
async function pixels(layer: string, hex: string): Promise<number> {
  return page.evaluate(
    ([name, colour]) => {
      const canvas = document.querySelector<HTMLCanvasElement>(`.painter-${name}`);
      const context = canvas?.getContext("2d");
      if (!canvas || !context) return 0;
      const wanted = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
      const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) {
        const far = wanted.some((value, channel) => Math.abs((data[i + channel] ?? 0) - value) > 24);
        if (!far && (data[i + 3] ?? 0) > 200) count++;
      }
      return count;
    },
    [layer, hex] as const,
  );
}

describe("signing in", () => {
  it("with a token in the address leads to the map, and the token leaves the address", async () => {
    await open(`${SIGNED_IN}&site=plant&level=ground`);
    await caughtUp();
    expect(page.url()).not.toContain(MOCK_TOKEN);
    expect(page.url()).toContain("#site=plant&level=ground");
    expect(await fact("live")).toBe("live");
    expect(complaints).toEqual([]);
    expect(strays).toEqual([]);
  });

  it("asks for a token, says when it is wrong, and goes on when it is right", async () => {
    await open("");
    await until("session", "out");
    await page.fill("#token", "wrong");
    await page.keyboard.press("Enter");
    await page.waitForSelector("text=does not know this token");
    await page.fill("#token", MOCK_TOKEN);
    await page.keyboard.press("Enter");
    await caughtUp();
    await page.reload();
    await caughtUp();
    await page.click("text=Sign out");
    await until("session", "out");
    expect(await page.isVisible("#token")).toBe(true);
  });

  it("is asked for again when the session ends", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    mock.endSessions();
    mock.step();
    await page.waitForSelector("text=Your session has ended");
  });
});

describe("the map", () => {
  it("shows segments, clusters, chains, robots and occupancy", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    const { segments, clusters, chains = 0, tiles } = mock.ground.describe().counts;
    expect(await fact("segments")).toBe(String(segments));
    expect(await fact("clusters")).toBe(String(clusters));
    expect(chains).toBeGreaterThan(0);
    expect(await fact("chains")).toBe(String(chains));
    expect(await fact("tiles")).toBe(String(tiles));
    expect(await fact("robots")).toBe("3");
    expect(Number(await fact("tilesLoaded"))).toBeGreaterThan(0);
    for (const colour of LIGHT.robots.slice(0, 3)) {
      expect(await pixels("segments", colour)).toBeGreaterThan(50);
      expect(await pixels("robots", colour)).toBeGreaterThan(50);
    }
    expect(await pixels("raster", "#ffffff")).toBeGreaterThan(1000);
    expect(await page.textContent(".robots")).toContain("sonar (emulated)");
    expect(await page.textContent(".contributions")).toContain("Sina");
  });

  it("follows what robots do within two seconds, without loading anew", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    await page.evaluate(() => {
      document.body.dataset["untouched"] = "yes";
    });
    const delaysMs: number[] = [];
    for (let i = 0; i < 5; i++) {
      const startMs = performance.now();
      mock.step();
      await until("revision", mock.ground.revision());
      delaysMs.push(performance.now() - startMs);
    }
    expect(delaysMs.sort((a, b) => a - b)[2]).toBeLessThan(2_000);
    await caughtUp();
    expect(await page.evaluate(() => document.body.dataset["untouched"])).toBe("yes");
    await page.waitForSelector(`.contributions >> text=#${mock.ground.revision()}`);
    expect(complaints).toEqual([]);
  });

  it("fetches only the pictures that a change touches", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    const pictures = (): string[] => mock.requests.filter((request) => request.includes("/tiles/"));
    const before = pictures();
    const all = new Set(before).size;
    expect(all).toBeGreaterThan(6);
    // Sina's sonars reach four metres.
    mock.tell("revision", mock.ground.look("sina"));
    await caughtUp();
    const after = pictures().slice(before.length);
    expect(after.length).toBeGreaterThan(0);
    expect(new Set(after).size).toBeLessThan(all / 2);
  });

  it("never blanks a picture while its successor is on the way", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    const shown = await pixels("raster", "#ffffff");
    await page.route("**/tiles/**", async (route) => {
      await new Promise((resolve) => setTimeout(resolve, 700));
      await route.continue();
    });
    mock.step();
    await until("revision", mock.ground.revision());
    expect(Number(await fact("tilesPending"))).toBeGreaterThan(0);
    expect(await pixels("raster", "#ffffff")).toBeGreaterThan(shown * 0.95);
    await caughtUp();
    await page.unroute("**/tiles/**");
  });

  it("forgets what was taken out", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    const [first] = mock.ground.vector(0).segments;
    const before = Number(await fact("segments"));
    mock.tell("revision", mock.ground.remove(first?.id ?? ""));
    await caughtUp();
    expect(await fact("segments")).toBe(String(before - 1));
  });
});

describe("the operator", () => {
  /** Where a point of the level is on the screen, from the permalink's view. */
  const at = async (xLevelM: number, yLevelM: number): Promise<readonly [number, number]> => {
    const fields = new URLSearchParams(new URL(page.url()).hash.slice(1));
    const box = await page.locator("#map").boundingBox();
    const [x, y, resolution] = ["x", "y", "resolution"].map((name) => Number(fields.get(name)));
    const middle = [(box?.x ?? 0) + (box?.width ?? 0) / 2, (box?.y ?? 0) + (box?.height ?? 0) / 2] as const;
    return [middle[0] + (xLevelM - (x ?? 0)) / (resolution ?? 1), middle[1] - (yLevelM - (y ?? 0)) / (resolution ?? 1)];
  };
  const IN_HALL = `${SIGNED_IN}&site=plant&level=ground&x=30&y=3&resolution=0.04`;

  it("chooses a segment and reads how good it is", async () => {
    await open(IN_HALL);
    await caughtUp();
    // The corridor's south wall y = 0, between two doorways.
    await page.mouse.click(...(await at(30, 0)));
    const card = page.locator(".selection");
    await card.waitFor();
    const text = await card.innerText();
    for (const word of ["Segment", "Quality", "Seen by", "Offset sd", "Angle sd", "First seen", "Last seen"]) {
      expect(text).toContain(word);
    }
    await page.keyboard.press("Escape");
    await card.waitFor({ state: "hidden" });
  });

  it("sees where the pointer is, in metres", async () => {
    await open(IN_HALL);
    await caughtUp();
    await page.mouse.move(...(await at(28.5, 1.25)));
    await page.waitForFunction(() => document.querySelector(".pointer")?.textContent === "x 28.50 m   y 1.25 m");
    expect(await page.textContent(".scale")).toContain("5 m");
  });

  it("shares what is shown by its address", async () => {
    await open(IN_HALL);
    await caughtUp();
    await page.uncheck("#layer-clusters");
    await page.locator("[aria-label='Opacity of Occupancy']").fill("40");
    const evidence = "[aria-label='Evidence that is shown']";
    const offered = await page.locator(`${evidence} option`).allTextContents();
    expect(offered).toEqual(["all layers", "scanners only", "sonar only", "prior only"]);
    expect(await page.textContent(".shades")).toContain("only in the prior");
    await page.selectOption(evidence, "sonar");
    await page.mouse.move(400, 400);
    await page.mouse.down();
    await page.mouse.move(300, 350, { steps: 5 });
    await page.mouse.up();
    await page.waitForFunction(() => !window.location.hash.includes("x=30.00"));
    await caughtUp();
    const address = page.url();
    expect(address).toContain("layers=raster:40,model,chains,segments,robots&evidence=sonar");
    await page.reload();
    await caughtUp();
    expect(page.url()).toBe(address);
    expect(await page.isChecked("#layer-clusters")).toBe(false);
    expect(await page.evaluate(() => document.querySelector<HTMLElement>(".painter-raster")?.style.opacity)).toBe("0.4");
    expect(mock.requests.at(-1)).not.toContain("layer=all");
  });

  it("shows the building as it was planned, at a height, from its publication on", async () => {
    await open(IN_HALL);
    await caughtUp();
    expect(await page.textContent(".layers")).toContain("This level has no model yet.");
    mock.model.enter("edit");
    mock.step();
    await page.waitForFunction(() => document.querySelector(".layers")?.textContent.includes("Nothing is published yet."));
    mock.model.enter("publication");
    mock.step();
    await until("model", "0.3 26");
    await caughtUp();
    expect(await pixels("model", LIGHT.model)).toBeGreaterThan(100);

    // Above its legs a table is a table.
    await page.fill("#model-height", "0.75");
    await page.keyboard.press("Enter");
    await until("model", "0.75 14");

    await page.check("#layer-landmarks");
    await until("landmarks", 4);
    await until("learned", 1);
    await page.mouse.click(...(await at(29.45, 0)));
    await page.waitForFunction(() => document.querySelector(".selection")?.textContent.includes("doorway"));
  });

  it("publishes the draft that it has read, and no other", async () => {
    await open(IN_HALL);
    await caughtUp();
    await page.click(".model-card summary");
    await page.waitForFunction(() => document.querySelector(".model-now")?.textContent === "This level has no model yet.");
    mock.model.enter("edit");
    mock.model.wrong = [{ severity: "error", code: "outside_wall", detail: "The doorway lies outside of its wall.", other: "wall", at_m: [28, 1.5, 0] }];
    mock.step();
    await page.waitForFunction(() => document.querySelector(".model-now")?.textContent.includes("has errors"));
    expect(await page.isDisabled("#model-publish")).toBe(true);
    await page.click(".findings .show");
    await page.waitForFunction(() => window.location.hash.includes("x=28.00&y=1.50"));

    mock.model.wrong = [];
    mock.model.enter("edit");
    mock.step();
    await page.waitForFunction(() => document.querySelector(".model-now")?.textContent.includes("another than what robots have"));
    // Somebody else edits; the page has not heard of it when the button is pressed.
    mock.model.enter("edit");
    await page.click("#model-publish");
    await page.waitForFunction(() => document.querySelector(".model-card .problem")?.textContent.includes("moved on"));
    complaints = complaints.filter((text) => !text.includes("412"));
    // By then it has read the new draft.
    await page.waitForFunction(() => document.querySelectorAll(".model-card .imports li").length === 3);
    await page.click("#model-publish");
    await page.waitForFunction(() => document.querySelector(".model-card .done")?.textContent.includes("Published"));
    await page.waitForFunction(() => document.querySelector(".model-now")?.textContent === "Robots have the draft as it is.");
    expect(complaints).toEqual([]);
  });

  it("can do with the keyboard alone", async () => {
    await open(IN_HALL);
    await caughtUp();
    await page.focus("#map");
    await page.keyboard.press("ArrowRight");
    await page.waitForFunction(() => !window.location.hash.includes("x=30.00"));
    await page.keyboard.press("g");
    await page.waitForFunction(() => window.location.hash.includes("grid"));
    await page.keyboard.press("f");
    await page.waitForFunction(() => !window.location.hash.includes("x="));
    expect(await page.getAttribute(".tools button:nth-child(3)", "aria-pressed")).toBe("true");
  });

  it("goes to a robot from the list", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    await page.click(".robots button:has-text('Bruno')");
    const pose = mock.ground.robots().find((robot) => robot.robot === "bruno")?.last_pose;
    await page.waitForFunction((x) => window.location.hash.includes(`x=${x}`), (pose?.x_m ?? 0).toFixed(2));
    expect(await page.textContent(".selection")).toContain("SICK LMS200, up to 15 m");
  });

  it("imports a map after seeing what is in it, and takes it away again", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    await page.click(".prior-card summary");
    await page.waitForSelector("text=There is none.");
    const choose = async (yaml: string): Promise<void> => {
      await page.setInputFiles("#prior-yaml", { name: "floor.yaml", mimeType: "text/yaml", buffer: Buffer.from(yaml) });
    };
    expect(await page.isDisabled("#prior-preview")).toBe(true);
    const pgm = Buffer.from("P5\n40 20\n255\n" + "\xfe".repeat(800), "latin1");
    await page.setInputFiles("#prior-image", { name: "floor.pgm", mimeType: "image/x-portable-graymap", buffer: pgm });

    // What is wrong is told with its place, and nothing is imported.
    await choose("image: floor.pgm\nresolution: fine\n");
    await page.click("#prior-preview");
    await page.waitForSelector(".prior-card .problem:has-text('line 2, column 13')");
    await page.waitForSelector("#prior-confirm", { state: "hidden" });

    await choose("image: floor.pgm\nresolution: 0.05\n");
    await page.fill("#prior-trust", "0.8");
    await page.click("#prior-preview");
    await page.waitForSelector(".prior-card .prior-told");
    await page.waitForSelector(".prior-card .problem", { state: "hidden" });
    const told = await page.innerText(".prior-card .prior-told");
    for (const words of ["floor.pgm, 40 × 20 pixels", "5 cm a pixel", "x -1.50 m, y 2.25 m", "trinary", "0.65", "0.196", "0.8"]) {
      expect(told).toContain(words);
    }
    expect(await page.innerText(".prior-card .prior-warnings")).toContain("yaw is 0");
    expect(mock.prior.imports).toHaveLength(0);

    // Another trust is another question.
    await page.fill("#prior-trust", "0.7");
    await page.waitForSelector("#prior-confirm", { state: "hidden" });
    await page.click("#prior-preview");
    await page.click("#prior-confirm");
    await page.waitForSelector(".prior-card .done:has-text('It is the prior')");
    expect(mock.prior.imports.map(({ report }) => report?.trust)).toEqual([0.7]);
    await page.waitForSelector(".imports li:has-text('floor.pgm: 1 tile, trust 0.7')");

    await page.click("#prior-remove");
    await page.waitForSelector(".imports li:has-text('Prior taken away')");
    await page.waitForSelector("text=There is none.");
    await page.waitForSelector("#prior-remove", { state: "hidden" });
    // A refusal that was asked for is a line of the console; there is no other.
    expect(complaints.filter((text) => !text.includes("422"))).toEqual([]);
    expect(strays).toEqual([]);
  });

  it("has all of it on a tablet too", async () => {
    await open(SIGNED_IN, { width: 800, height: 1100 });
    await caughtUp();
    expect(await page.isVisible("#panels")).toBe(false);
    await page.click(".panels-toggle");
    await page.waitForSelector("#panels .robots", { state: "visible" });
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    expect(wide).toBeLessThanOrEqual(800);
  });
});

describe("a view that follows the level", () => {
  const FIT = ".tools button:has-text('Fit')";
  /** Metres per pixel in the address; null while the view follows the level. */
  const resolution = (): number | null => {
    const text = new URLSearchParams(new URL(page.url()).hash.slice(1)).get("resolution");
    return text === null ? null : Number(text);
  };
  /** Length of the scale bar's metres on the screen and in words: it changes with every zoom. */
  const scale = async (): Promise<string> =>
    `${await page.locator(".scale .bar").evaluate((bar: HTMLElement) => bar.style.width)} ${await page.innerText(".scale")}`;
  const follows = async (): Promise<boolean> => (await page.getAttribute(FIT, "aria-pressed")) === "true";
  /** Metres per pixel that the scale bar says. */
  const metresPerPixel = async (): Promise<number> => {
    const [, px = "", length = "", unit = ""] = /^([\d.]+)px ([\d.]+)\s*(cm|m)/.exec(await scale()) ?? [];
    return (Number(length) * (unit === "cm" ? 0.01 : 1)) / Number(px);
  };
  /** The map has stood still for a while, news of the level included. */
  const settle = async (): Promise<void> => {
    await page.waitForTimeout(600);
    mock.step();
    await caughtUp();
  };
  const start = async (): Promise<number> => {
    await open(SIGNED_IN);
    await caughtUp();
    expect(await follows()).toBe(true);
    expect(resolution()).toBe(null);
    return metresPerPixel();
  };
  const middle = async (): Promise<readonly [number, number]> => {
    const box = await page.locator("#map").boundingBox();
    return [(box?.x ?? 0) + (box?.width ?? 0) / 2, (box?.y ?? 0) + (box?.height ?? 0) / 2];
  };
  const wheel = async (deltaY: number): Promise<void> => {
    await page.mouse.move(...(await middle()));
    await page.mouse.wheel(0, deltaY);
  };
  const pinch = async (): Promise<void> => {
    const [x, y] = await middle();
    const session = await page.context().newCDPSession(page);
    const touch = async (type: "touchStart" | "touchMove" | "touchEnd", apart: number): Promise<void> => {
      const touchPoints = type === "touchEnd" ? [] : [{ x: x - apart, y, id: 0 }, { x: x + apart, y, id: 1 }];
      await session.send("Input.dispatchTouchEvent", { type, touchPoints });
    };
    await touch("touchStart", 40);
    for (const apart of [50, 65, 80, 100]) await touch("touchMove", apart);
    await touch("touchEnd", 100);
  };
  const WAYS: Record<string, { act: () => Promise<void>; nearer: boolean }> = {
    "the wheel, inwards": { act: () => wheel(-240), nearer: true },
    "the wheel, outwards": { act: () => wheel(240), nearer: false },
    "a touchpad's small steps": { act: () => wheel(-3), nearer: true },
    "the + button": { act: () => page.click("[aria-label^='Zoom in']"), nearer: true },
    "the \u2212 button": { act: () => page.click("[aria-label^='Zoom out']"), nearer: false },
    "the + key": { act: () => page.keyboard.press("+"), nearer: true },
    "the + key on the map": {
      act: async () => {
        await page.focus("#map");
        await page.keyboard.press("+");
      },
      nearer: true,
    },
    "two fingers": { act: pinch, nearer: true },
  };

  it.each(Object.entries(WAYS))("is left by %s, for good", async (_way, { act, nearer }) => {
    const whole = await start();
    await act();
    await settle();
    expect(await follows()).toBe(false);
    const zoomed = resolution() ?? NaN;
    expect(nearer ? zoomed < whole * 0.995 : zoomed > whole * 1.005).toBe(true);
    expect(await metresPerPixel()).toBeCloseTo(zoomed, 3);
    await settle();
    expect(resolution()).toBe(zoomed);
    expect(complaints).toEqual([]);
  });

  it("is left by dragging, at the same scale", async () => {
    await start();
    const before = await scale();
    const [x, y] = await middle();
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x - 60, y - 40, { steps: 4 });
    await page.waitForFunction(() => window.location.hash.includes("resolution="));
    await page.mouse.up();
    await settle();
    expect(await follows()).toBe(false);
    expect(await scale()).toBe(before);
  });

  it("is back when asked for, even while the map still moves", async () => {
    const whole = await start();
    await wheel(-480);
    await settle();
    expect(await metresPerPixel()).toBeLessThan(whole * 0.9);
    await page.click("[aria-label^='Zoom in']");
    await page.click(FIT);
    await settle();
    expect(await follows()).toBe(true);
    expect(resolution()).toBe(null);
    expect(await metresPerPixel()).toBeGreaterThan(whole * 0.9);
  });

  it("keeps up with a level that grows", async () => {
    await mock.close();
    mock = createMockServer();
    origin = await mock.listen();
    mock.step();
    const early = await start();
    for (let i = 0; i < 6; i++) {
      mock.step(5);
      await caughtUp();
    }
    expect(await follows()).toBe(true);
    expect(resolution()).toBe(null);
    expect(await metresPerPixel()).toBeGreaterThan(early * 1.05);
  });
});

describe("in words", () => {
  it("tells of a level that is empty, and draws it once a robot comes", async () => {
    await open(`${SIGNED_IN}&site=plant&level=upper`);
    await page.waitForSelector("text=Nothing here yet");
    expect(await page.textContent(".notice pre")).toContain("--level upper");
    await page.selectOption("#level", "ground");
    await caughtUp();
    expect(await page.isVisible(".notice")).toBe(false);
  });

  it("tells how to make a site", async () => {
    await mock.close();
    mock = createMockServer({ noSites: true });
    origin = await mock.listen();
    await open(SIGNED_IN);
    await page.waitForSelector("text=No site yet");
    expect(await page.textContent(".notice pre")).toContain(`mapfold-robot replay LOG --server ${origin}`);
  });

  it("tells that the server is gone, and goes on by itself when it is back", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    await page.route("**/api/**", (route) => route.abort());
    mock.dropStreams();
    await until("live", "lost");
    await page.waitForSelector("text=The server cannot be reached");
    expect(Number(await fact("segments"))).toBeGreaterThan(0);
    mock.step(2);
    await page.unroute("**/api/**");
    await until("live", "live");
    await caughtUp();
    expect(await page.isVisible(".warning")).toBe(false);
  });

  it("tells that the server cannot be reached from the start", async () => {
    await open("");
    await until("session", "out");
    await page.route("**/api/**", (route) => route.abort());
    await page.reload();
    await page.waitForSelector("text=The server cannot be reached");
    await page.unroute("**/api/**");
    await page.click("text=Try again");
    await until("session", "out");
  });

  it("shows a level that was replaced as it is now", async () => {
    await open(SIGNED_IN);
    await caughtUp();
    mock.ground.replace();
    mock.step();
    await caughtUp();
    await until("segments", mock.ground.describe().counts.segments);
  });
});
