// Bundles the page into one file: node build.mjs OUT.html
import { build } from 'esbuild';
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2];
const result = await build({
  entryPoints: [join(here, 'src/main.js')],
  bundle: true,
  minify: true,
  format: 'iife',
  target: ['chrome100', 'firefox100', 'safari15'],
  charset: 'utf8',
  legalComments: 'inline', // the libraries' licences ask that their notices stay
  write: false,
  outdir: here,
});
const text = (end) => result.outputFiles.find((file) => file.path.endsWith(end)).text;
const page = readFileSync(join(here, 'src/page.html'), 'utf8')
  // Functions: a `$` in the bundle stays what it is.
  .replace('/*css*/', () => text('.css'))
  .replace('/*js*/', () => text('.js').replaceAll('</script', '<\\/script'));
mkdirSync(dirname(out), { recursive: true });
writeFileSync(out, page);
