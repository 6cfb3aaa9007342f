// Drawing the model on the built page in Chromium, against a made-up server.

import type { Browser, Page } from "playwright-core";
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, it } from "vitest";
import { launchBrowser } from "../../e2e/browser.mjs";
import { createMockServer, MOCK_TOKEN } from "../mock/server.mjs";

let browser: Browser;
let mock: ReturnType<typeof createMockServer>;
let origin: string;
let page: Page;
/** What a browser complains about. */
let complaints: string[];

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
  page = await (await browser.newContext({ viewport: { width: 1280, height: 800 } })).newPage();
  complaints = [];
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") complaints.push(message.text());
  });
  page.on("pageerror", (error) => complaints.push(error.message));
});
afterEach(async () => {
  await page.context().close();
  await mock.close();
});

async function until(name: string, value: number): Promise<void> {
  await page.waitForFunction(([key, wanted]) => document.documentElement.dataset[key] === wanted, [name, String(value)] as const);
}

describe("the editor", () => {
  it("draws walls by typed lengths, and keeps them until they are sent", async () => {
    await page.goto(`${origin}/#token=${MOCK_TOKEN}&site=plant&level=ground`);
    await page.waitForSelector("#edit-model");
    await page.click("#edit-model");
    await until("objects", 0);
    await page.keyboard.press("w");
    const map = await page.locator("#map").boundingBox();
    await page.mouse.click((map?.x ?? 0) + (map?.width ?? 0) / 2, (map?.y ?? 0) + (map?.height ?? 0) / 2);
    await page.waitForSelector("#edit-length", { state: "visible" });
    for (const [length, angle] of [["3", "0"], ["2,5", "90"]] as const) {
      await page.keyboard.type(length);
      await page.waitForSelector("#edit-length:focus");
      await page.keyboard.press("Tab");
      await page.keyboard.type(angle);
      await page.keyboard.press("Enter");
    }
    await page.keyboard.press("Enter");
    await until("unsent", 2);
    await page.reload();
    await until("unsent", 2);
    await page.keyboard.press("Control+s");
    await page.waitForSelector("text=In the draft: 2 objects");
    await until("unsent", 0);
    const { features } = mock.model.collection();
    const sizes = features.flatMap(({ properties }) => properties.solids?.[0] ?? []).map((solid) => ("box" in solid ? solid.box.to_m : []));
    expect(sizes.sort()).toEqual([[2.5, 0.05, 2.5], [3, 0.05, 2.5]]);
    expect(complaints).toEqual([]);
  });
});
