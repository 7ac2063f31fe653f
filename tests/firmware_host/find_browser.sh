# Sourced by tests that open the page: find_browser PAGE_FOLDER sets `browser`, or ends the test as skipped (77) where
# there is no Chromium, no node or no bundle of the page.
find_browser() {
  missing=
  remedy='toolchain/install.sh test optional, then toolchain/test.sh'
  browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || missing="there is no chromium"
  command -v node >/dev/null 2>&1 || missing="there is no node"
  [ -d "$1/node_modules/playwright-core" ] || missing="the page was built without npm"
  [ -n "$missing" ] || return 0
  echo "SKIPPED: $missing; run with: $remedy"
  exit 77
}
