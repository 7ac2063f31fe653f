// Opens `swiftlet view RUN` in headless Chromium: node check_playback.mjs CHROMIUM URL images|none [SCREENSHOT.png [SECONDS]]
// Goes through the run by keys, slider, a click on a plot and by playing; exit code 1 when the console shows an error,
// anyone but the server is asked, or images, 3D view and plots do not show the moment that was chosen.
import { findBlankPlots, inBrowser, watch } from './browser.mjs';

const [executablePath, url, expected, screenshot, seconds] = process.argv.slice(2);
const withImages = expected === 'images';

await inBrowser(executablePath, async (context, faults) => {
  const page = await context.newPage();
  page.setDefaultTimeout(60000); // of a busy machine
  watch(page, faults, (asked) => asked.startsWith(url.split('?')[0]));
  await page.goto(url);
  await page.waitForFunction(() => window.swiftletReport?.ready);

  /** What the page shows once the answer for its moment has come. */
  const shown = async () => {
    await page.waitForFunction(() => {
      const { playback, panel } = window.swiftletReport.runs[0];
      if (playback.asking || playback.asked !== playback.index) return false;
      return !panel?.inSight || panel.message?.frame === playback.index;
    });
    return page.evaluate(() => {
      const run = window.swiftletReport.runs[0];
      const line = document.querySelector('.moment-line');
      const odometry = run.view?.trajectories.find((one) => one.data.name === 'odometry');
      return {
        index: run.playback.index,
        t: run.playback.t[run.playback.index],
        fault: run.playback.fault,
        keyframe: run.playback.keyframes[run.playback.index],
        line: line && new DOMMatrix(getComputedStyle(line).transform).e,
        lines: [...document.querySelectorAll('.moment-line')].filter((one) => one.style.display === 'block').length,
        dots: [...document.querySelectorAll('.moment-dot')].filter((one) => one.style.display === 'block').length,
        pieces: odometry?.line.geometry.instanceCount,
        vehicle: run.view?.vehicle?.position.toArray(),
        image: run.panel?.message,
        layers: run.panel?.count(),
        mesh: run.view?.surfaces.find((one) => one.data.id === 'local_mesh')?.data.points.slice(0, 40),
      };
    });
  };
  const expect = (good, what) => { if (!good) faults.push(what); };
  const check = (one, index) => {
    expect(one.index === index, `moment ${one.index} where ${index} was to be`);
    expect(!one.fault, `moment ${index}: ${one.fault}`);
    expect(one.lines > 10 && one.dots === 2, `moment ${index} stands in ${one.lines} plots and ${one.dots} planes`);
    if (!withImages) return;
    expect(one.image?.frame === index && one.image.cameras.length === 2 && one.image.cameras.every((c) => c?.src),
      `moment ${index} shows the images of ${one.image?.frame}`);
    expect(Boolean(one.image?.cameras[0]?.tracks) === Boolean(one.keyframe), `moment ${index}: features`);
    if (one.keyframe) expect(one.layers.tracks > 50, `keyframe ${index} shows ${one.layers.tracks} features`);
  };

  const start = await shown();
  check(start, 0);
  await page.keyboard.press('ArrowRight');
  await page.keyboard.press('ArrowRight');
  check(await shown(), 2);
  await page.keyboard.press('ArrowLeft');
  check(await shown(), 1);
  await page.keyboard.press('Shift+ArrowRight');
  const keyframe = await shown();
  expect(!withImages || keyframe.keyframe === 1, 'Shift and right end at no keyframe');

  const count = await page.evaluate(() => window.swiftletReport.runs[0].playback.t.length);
  const middle = Math.floor(count / 2);
  await page.evaluate((i) => {
    const { slider } = window.swiftletReport.runs[0].playback;
    slider.value = i;
    slider.dispatchEvent(new Event('input'));
  }, middle);
  const half = await shown();
  check(half, middle);
  expect(half.line > start.line + 20, `the line in the plots went from ${start.line} to ${half.line} px`);
  expect(half.pieces > 0.4 * count && half.pieces < 0.6 * count, `${half.pieces} pieces of the way are flown at half of it`);
  expect(String(half.vehicle) !== String(start.vehicle), 'the vehicle does not move');
  expect(!withImages || half.mesh !== start.mesh, 'the mesh does not change');

  // A click on a plot chooses the moment there, also if the page scrolls and moves meanwhile.
  const over = page.locator('figure[data-plot=velocity] .u-over');
  await over.scrollIntoViewIfNeeded();
  const box = await over.boundingBox();
  await page.mouse.move(box.x + 0.75 * box.width, box.y + 0.5 * box.height);
  await page.mouse.down();
  await page.evaluate(() => window.dispatchEvent(new Event('scroll')));
  await page.mouse.up();
  const clicked = await shown();
  const at = await page.evaluate((share) => {
    const { plot } = window.swiftletReport.runs[0].plots.get('velocity');
    return plot.posToVal(share * plot.over.clientWidth, 'x');
  }, 0.75);
  expect(Math.abs(clicked.t - at) < 0.1, `a click at ${at} s chose ${clicked.t} s`);

  // Played to the end, where it stops.
  await page.evaluate(() => { window.scrollTo(0, 0); window.swiftletReport.runs[0].playback.speed = 5; });
  await page.keyboard.press('Space');
  await page.waitForFunction((n) => window.swiftletReport.runs[0].playback.index === n - 1
    && !window.swiftletReport.runs[0].playback.playing, count);
  check(await shown(), count - 1);
  const moments = await page.evaluate(() => window.swiftletReport.runs[0].panel?.shown ?? 0);
  expect(!withImages || moments > 6, `only ${moments} moments had images`);

  if (seconds) {
    await page.evaluate((t) => window.swiftletReport.runs[0].playback.goTo(Number(t)), seconds);
    await shown();
  }
  if (screenshot) {
    await page.waitForTimeout(500);
    await page.screenshot({ path: screenshot });
  }
  await findBlankPlots(page, faults);
  const figures = await page.evaluate(() => window.swiftletReport.figures()[0]);
  expect(figures.sceneColours >= 8, `the 3D view does not draw (${figures.sceneColours} colours)`);
  expect(Boolean(figures.images) === withImages, 'images where none were expected, or none');
  console.log(`${count} moments, ${moments} shown with images, ${figures.sceneColours} colours in 3D`);
});
