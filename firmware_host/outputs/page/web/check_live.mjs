// Opens the live view of a replay in headless Chromium, then interrupts the replay and sees it end:
// node check_live.mjs CHROMIUM URL PID [SCREENSHOT.png]
// Exit code 1 when the console shows an error, anything but the server is asked, a plot has no data, does not grow or
// is blank, images or their layers are not drawn, the 3D view does not draw, or the page does not say that the run has
// ended.
import { findBlankPlots, inBrowser, watch } from './browser.mjs';

const [executablePath, url, replay, screenshot] = process.argv.slice(2);
const figures = (page) => page.evaluate(() => window.swiftletReport.figures()[0]);

await inBrowser(executablePath, async (context, faults) => {
  const page = await context.newPage();
  let ended = false;
  // After the end nobody answers any more.
  watch(page, faults, (asked) => asked.startsWith(url), () => ended);
  await page.goto(url);
  await page.waitForFunction(() => window.swiftletReport?.ready && window.swiftletReport.live.state === 'live'
    && window.swiftletReport.live.patches > 3
    // Before the first pose there is nothing to plot.
    && Object.values(window.swiftletReport.figures()[0].plots).every((points) => points > 0), null, { timeout: 60000 });
  const early = await figures(page);
  await page.waitForFunction((before) => {
    const { plots } = window.swiftletReport.figures()[0];
    return Object.keys(plots).every((id) => plots[id] > (before[id] ?? 0));
  }, early.plots, { timeout: 60000 }).catch(() => {});  // those that did not grow are named below
  // What is out of sight is drawn when it comes into sight.
  await page.evaluate(async () => {
    for (const figure of document.querySelectorAll('figure, .scene')) {
      figure.scrollIntoView();
      await new Promise((resolve) => setTimeout(resolve, 60));
    }
    window.scrollTo(0, 0);
  });
  // A busy machine draws few.
  await page.waitForFunction(() => window.swiftletReport.figures()[0].images?.shown > 5, null, { timeout: 60000 })
    .catch(() => faults.push('images are not shown'));
  const late = await figures(page);
  await findBlankPlots(page, faults);
  const { images } = late;
  if (!(images?.tracks > 20 && images?.tails > 20)) faults.push(`tracks are not drawn: ${JSON.stringify(images)}`);
  // Every layer is drawn on request, but a loop's, which has to be found first.
  const layers = await page.evaluate(async () => {
    for (const box of document.querySelectorAll('.layer input')) if (!box.checked) box.click();
    const { panel } = window.swiftletReport.runs[0];
    const most = {};
    for (let i = 0; i < 40; i += 1) {
      for (const [layer, count] of Object.entries(panel.count())) most[layer] = Math.max(most[layer] ?? 0, count);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    return most;
  });
  for (const layer of ['stereo', 'rejected', 'mesh']) {
    if (!(layers[layer] > 0)) faults.push(`layer ${layer} is not drawn: ${JSON.stringify(layers)}`);
  }
  const greys = await page.evaluate(() => [...document.querySelectorAll('.images canvas')].map((canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return new Set(data.filter((_, i) => i % 4 === 0)).size;
  }));
  if (greys.length !== 2 || !greys.every((count) => count > 30)) faults.push(`the images show ${greys} greys`);
  const ids = Object.keys(late.plots);
  if (ids.length < 10) faults.push(`only ${ids.length} plots`);
  for (const id of ids) {
    if (!(late.plots[id] > early.plots[id])) faults.push(`plot ${id} does not grow: ${early.plots[id]}, ${late.plots[id]}`);
  }
  if (!(late.timeline > 0)) faults.push('the timeline is empty');
  if (late.sceneColours < 8) faults.push(`the 3D view does not draw (${late.sceneColours} colours)`);
  const bar = await page.locator('.live').innerText();
  if (!/live/.test(bar) || !/arm/.test(bar)) faults.push(`the bar says: ${bar}`);
  if (screenshot) await page.screenshot({ path: screenshot, fullPage: true });
  process.kill(Number(replay), 'SIGINT');
  await page.waitForFunction(() => window.swiftletReport.live.state === 'ended', null, { timeout: 120000 });
  ended = true;
  const stale = await page.evaluate(() => ['health', 'arming']
    .map((part) => document.querySelector(`.live .${part}`).textContent).join(''));
  if (stale) faults.push(`after the end the bar says: ${stale}`);
  const { documents, patches } = await page.evaluate(() => {
    const { documents, patches } = window.swiftletReport.live;
    return { documents, patches };
  });
  if (documents !== 1) faults.push(`${documents} documents where one was to do`);
  // What comes in a long run only: series thinned and sent anew, and, for a slow viewer, another document.
  const replaced = await page.evaluate(async () => {
    const report = window.swiftletReport;
    const plots = ['velocity', 'plan'].map((id) => {
      const { series } = report.document.runs[0].plots.find((p) => p.id === id);
      return { id, replace: true, series: series.map(({ name }) => ({ name, x: [0, 1, 2], y: [1, 2, 3], value: [1, 1, 1] })) };
    });
    const scene = { trajectories: [{ name: 'odometry', replace: true, points: [0, 0, 0, 1, 1, 1], value: [0, 1] }] };
    report.append({ run: 0, plots, scene, live: {}, duration: 3 });
    const { plots: counts } = report.figures()[0];
    const points = report.runs[0].view.trajectories[0].points.length;
    // The first document was an early one: it gets what is drawn now.
    const { scene: drawn } = report.document.runs[0];
    drawn.surfaces = report.runs[0].view.surfaces.filter((s) => s.corner).map((s) => s.data);
    await report.load(report.document);
    const again = report.figures()[0];
    return { counts: [counts.velocity, counts.plan], points, again: again.sceneColours, canvases: document.querySelectorAll('.scene canvas').length };
  });
  if (String(replaced.counts) !== '9,3' || replaced.points !== 6) faults.push(`replaced series have ${JSON.stringify(replaced)}`);
  if (replaced.again < 8 || replaced.canvases !== 1) faults.push(`after a second document: ${JSON.stringify(replaced)}`);
  const total = Object.values(late.plots).reduce((sum, n) => sum + n, 0);
  console.log(`${ids.length} plots with ${total} points, ${late.sceneColours} colours in 3D, ${images?.shown} instants of images, ${patches} patches until the end`);
});
