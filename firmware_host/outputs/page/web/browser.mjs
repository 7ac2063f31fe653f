// A headless Chromium for the checks of the page: started, watched, and put away again.
import { chromium } from 'playwright-core';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

/// Gives check(context, faults) a browser, then prints the faults and ends the process: 1 where there are any.
export async function inBrowser(executablePath, check) {
  const profile = mkdtempSync(join(tmpdir(), 'swiftlet_browser_'));
  const faults = [];
  const context = await chromium.launchPersistentContext(profile, {
    executablePath,
    headless: true,
    viewport: { width: 1500, height: 1000 },
    args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
      '--disable-component-update', '--disable-sync', '--use-gl=angle', '--use-angle=swiftshader',
      '--enable-unsafe-swiftshader'],
  });
  try {
    await check(context, faults);
  } catch (error) {
    faults.push(String(error));
  } finally {
    await context.close();
    rmSync(profile, { recursive: true, force: true });
  }
  for (const fault of faults) console.log(`FAULT ${fault}`);
  process.exit(faults.length ? 1 : 0);
}

/// What the console says, what is thrown, and what is asked of anyone else are faults, unless quiet() says not to look.
export function watch(page, faults, isOwn, quiet = () => false) {
  page.on('console', (message) => {
    // The drawing of a test is read back; that this is slow is no fault of the page.
    if (quiet() || !['error', 'warning'].includes(message.type()) || /ReadPixels|getImageData/.test(message.text())) return;
    faults.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => faults.push(`error: ${error.message}`));
  page.on('request', (request) => {
    if (!isOwn(request.url()) && !/^(data|blob):/.test(request.url())) faults.push(`asks ${request.url()}`);
  });
}

/// The plots with nothing drawn in them, as faults.
export async function findBlankPlots(page, faults) {
  const blank = await page.evaluate(() => [...document.querySelectorAll('figure, .alone, .beside')].flatMap((host) =>
    [...host.querySelectorAll('.uplot canvas')].filter((canvas) => {
      const { width, height } = canvas;
      const pixels = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, width, height).data.buffer);
      return new Set(pixels).size < 3;
    }).map((canvas) => canvas.closest('figure')?.dataset.plot ?? 'timeline')));
  for (const id of new Set(blank)) faults.push(`plot ${id} is blank`);
}
