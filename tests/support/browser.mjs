// What the tests of pages in headless Chromium share: playwright-core, Chromium, and a list of what holds.
import { existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import { delimiter, join } from 'node:path';

function skip(reason) {
  console.log(`skipped: ${reason}; tools/test_report installs it`);
  process.exit(77);
}

function findPlaywright(modules) {
  const require = createRequire(import.meta.url);
  const paths = [modules, ...(process.env.NODE_PATH ?? '').split(delimiter).filter(Boolean)];
  try {
    return require(require.resolve('playwright-core', { paths }));
  } catch {
    return skip('there is no playwright-core');
  }
}

function findChromium() {
  const folders = process.env.PATH.split(delimiter);
  const places = ['chromium', 'chromium-browser', 'google-chrome'].flatMap((name) => folders.map((f) => join(f, name)));
  return [process.env.CHROMIUM, ...places].find((path) => path && existsSync(path)) ?? skip('there is no Chromium');
}

// Playwright's chromium and the program's path; ends with status 77 (skipped) where one is missing. The variable
// CHROMIUM names another Chromium than that in PATH.
export function chromiumOf(modules) {
  return { chromium: findPlaywright(modules).chromium, executablePath: findChromium() };
}

const began = Date.now();
let failures = 0;

export function check(what, holds, detail = '') {
  console.log(`${((Date.now() - began) / 1000).toFixed(1).padStart(5)} s  ${holds ? 'ok    ' : 'FAILED'} ${what}${detail === '' ? '' : `: ${detail}`}`);
  if (!holds) ++failures;
}

// Ends the test: with status 1 where something did not hold.
export function end() {
  console.log(failures === 0 ? 'all hold' : `${failures} failed`);
  process.exit(failures === 0 ? 0 : 1);
}
