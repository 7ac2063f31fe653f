// Opens reports in headless Chromium: node check_page.mjs CHROMIUM REPORT.html ... [SCREENSHOT.png [SELECTOR]]
// Exit code 1 when the console shows an error, something is fetched, a plot has no data or is blank, or the 3D
// view does not draw.
import { chromium } from 'playwright-core';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [executablePath, ...rest] = process.argv.slice(2);
const reports = rest.filter((argument) => argument.endsWith('.html'));
const [screenshot, focus] = rest.filter((argument) => !argument.endsWith('.html'));
const profile = mkdtempSync(join(tmpdir(), 'swiftlet_page_'));
const faults = [];
const context = await chromium.launchPersistentContext(profile, {
  executablePath,
  headless: true,
  viewport: { width: 1500, height: 1000 },
  args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--use-gl=angle', '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader'],
});

async function check(page, report) {
  page.on('console', (message) => {
    if (message.type() === 'error' || message.type() === 'warning') {
      // The drawing of a test is read back; that this is slow is no fault of the page.
      if (!/ReadPixels|getImageData/.test(message.text())) faults.push(`console: ${message.text()}`);
    }
  });
  page.on('pageerror', (error) => faults.push(`error: ${error.message}`));
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) faults.push(`fetches ${request.url()}`);
  });
  const begin = Date.now();
  await page.goto(pathToFileURL(resolve(report)).href);
  await page.waitForFunction(() => window.swiftletReport?.ready, null, { timeout: 60000 });
  const loaded = (Date.now() - begin) / 1000;
  const times = await page.evaluate(() => window.swiftletReport.times);
  const runs = await page.evaluate(() => window.swiftletReport.figures());
  const blank = await page.evaluate(() => [...document.querySelectorAll('figure, .alone, .beside')].flatMap((host) =>
    [...host.querySelectorAll('.uplot canvas')].filter((canvas) => {
      const { width, height } = canvas;
      const pixels = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, width, height).data.buffer);
      return new Set(pixels).size < 3;
    }).map((canvas) => canvas.closest('figure')?.dataset.plot ?? 'timeline')));
  for (const id of new Set(blank)) faults.push(`plot ${id} is blank`);
  for (const run of runs) {
    const ids = Object.keys(run.plots);
    if (ids.length === 0) faults.push(`${run.name} has no plot`);
    for (const id of ids) if (!(run.plots[id] > 0)) faults.push(`plot ${id} of ${run.name} has no data`);
    if (!(run.timeline > 0)) faults.push(`${run.name} has an empty timeline`);
    if (run.sceneColours < 8) faults.push(`the 3D view of ${run.name} does not draw (${run.sceneColours} colours)`);
    console.log(`${run.name}: ${ids.length} plots, ${run.timeline} on the timeline, ${run.sceneColours} colours in 3D`);
  }
  if (screenshot) {
    const where = focus ? page.locator(focus).first() : page;
    await where.screenshot({ path: screenshot, fullPage: focus ? undefined : true });
  }
  // What a live view will do: every plot over time takes more.
  const grown = await page.evaluate(() => {
    const one = window.swiftletReport.document.runs[0].plots.find((p) => p.kind === 'time');
    if (!one) return true;
    const before = window.swiftletReport.figures()[0].plots[one.id];
    window.swiftletReport.append({ run: 0, plots: [{ id: one.id, series: [{ name: one.series[0].name, x: [1e3], y: [0] }] }] });
    return window.swiftletReport.figures()[0].plots[one.id] === before + 1;
  });
  if (!grown) faults.push('a plot does not take appended data');
  console.log(`plots after ${(times.plots / 1000).toFixed(2)} s, 3D view after ${(times.scene / 1000).toFixed(2)} s, all after ${loaded.toFixed(2)} s`);
}

try {
  for (const report of reports) {
    const page = await context.newPage();
    await check(page, report);
    await page.close();
  }
} finally {
  await context.close();
  rmSync(profile, { recursive: true, force: true });
}
for (const fault of faults) console.log(`FAULT ${fault}`);
process.exit(faults.length ? 1 : 0);
