// Opens reports in headless Chromium: node check_page.mjs CHROMIUM REPORT.html ... [SCREENSHOT.png [SELECTOR]]
// Exit code 1 when the console shows an error, something is fetched, a plot has no data or is blank, or the 3D
// view does not draw.
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { findBlankPlots, inBrowser, watch } from './browser.mjs';

const [executablePath, ...rest] = process.argv.slice(2);
const reports = rest.filter((argument) => argument.endsWith('.html'));
const [screenshot, focus] = rest.filter((argument) => !argument.endsWith('.html'));

async function check(page, report, faults) {
  watch(page, faults, (asked) => asked.startsWith('file:'));
  const begin = Date.now();
  await page.goto(pathToFileURL(resolve(report)).href);
  await page.waitForFunction(() => window.swiftletReport?.ready, null, { timeout: 60000 });
  const loaded = (Date.now() - begin) / 1000;
  // Images are drawn in sight only.
  await page.evaluate(() => document.querySelector('.images')?.scrollIntoView());
  await page.waitForFunction(() => window.swiftletReport.runs.every((run) => !run.panel || run.panel.shown > 0), null,
    { timeout: 20000 });
  await page.evaluate(() => window.scrollTo(0, 0));
  const times = await page.evaluate(() => window.swiftletReport.times);
  const runs = await page.evaluate(() => window.swiftletReport.figures().map((one, i) => {
    const { first_image_ns: first, scene } = window.swiftletReport.document.runs[i];
    const features = Boolean(window.swiftletReport.runs[i].panel?.message?.cameras[0]?.tracks);
    return { ...one, flight: first != null, hasScene: scene != null, features };
  }));
  await findBlankPlots(page, faults);
  for (const run of runs) {
    const ids = Object.keys(run.plots);
    if (ids.length === 0) faults.push(`${run.name} has no plot`);
    for (const id of ids) if (!(run.plots[id] > 0)) faults.push(`plot ${id} of ${run.name} has no data`);
    if (run.flight && !(run.timeline > 0)) faults.push(`${run.name} has an empty timeline`);
    if (run.hasScene && run.sceneColours < 8) faults.push(`the 3D view of ${run.name} does not draw (${run.sceneColours} colours)`);
    if (run.features && !(run.images.tracks > 50)) faults.push(`over the image of ${run.name} are ${run.images.tracks} features`);
    console.log(`${run.name}: ${ids.length} plots, ${run.moments} images, ${run.timeline} on the timeline, ${run.sceneColours} colours in 3D`);
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

await inBrowser(executablePath, async (context, faults) => {
  for (const report of reports) {
    const page = await context.newPage();
    await check(page, report, faults);
    await page.close();
  }
});
