"""How the panel looks in the dark and on a telephone, with Stop always in sight: a style sheet in
the panel, as viser has no other place.

The scene follows, too: its colours are seen on white and on the dark page.
"""

from dart_skill.common.palette import BLACK, DARK_INK, DARK_PAGE, GREY, STOP, hexadecimal

SAYS_LINES = 4
"""Lines of room for what goes on, so that nothing moves when a line wraps; more can be scrolled
to.
"""
SCENE_SHARE = 0.45
"""Share of the height of a telephone that the scene has; the panel has the rest."""
STYLE = (
    (
        f"""<style>
:root {{ --ds-ink: {hexadecimal(BLACK)}; --ds-quiet: {hexadecimal(GREY)}; --ds-alarm: {hexadecimal(STOP)};
  --ds-scene: {SCENE_SHARE:.0%}; --ds-panel: {1.0 - SCENE_SHARE:.0%}; }}
.ds-says {{ height: {1.4 * SAYS_LINES}em; line-height: 1.4; overflow-y: auto; font-size: 0.85em; margin: 0.3em 0.8em;
  color: var(--ds-ink); }}
.ds-says.alarm {{ color: var(--ds-alarm); }}
"""
        """
.ds-quiet { padding: 0.4em 0.8em; font-size: 0.85em; color: var(--ds-quiet); }
.ds-node { padding: 0.1em 0.8em; font-size: 0.8em; color: var(--ds-ink); }
.ds-swatch { font-size: 0.8em; line-height: 1.5; break-inside: avoid; color: var(--ds-ink); }
.ds-swatch span { display: inline-block; width: 0.8em; height: 0.8em; margin-right: 0.5em; outline: 1px solid #8888; }
.mantine-ScrollArea-content div:has(.ds-says) { overflow: visible !important; min-width: 0; grid-template-columns: minmax(0, 1fr); }
.mantine-ScrollArea-content div:has(> div > .ds-says) > div:first-child {
  position: sticky; top: 0; z-index: 5; background: var(--mantine-color-body); }
@media (prefers-color-scheme: dark) {
  :root[data-mantine-color-scheme] {
    --ds-ink: DARK_INK; --ds-quiet: #a8adb3; --ds-alarm: #ff9a52; color-scheme: dark;
    --mantine-color-body: #1f2226; --mantine-color-text: #e6e6e6; --mantine-color-black: #e6e6e6; --mantine-color-dimmed: #a8adb3;
    --mantine-color-default: #2a2e33; --mantine-color-default-color: #e6e6e6; --mantine-color-default-border: #4a5057;
    --mantine-color-default-hover: #343a40; --mantine-color-placeholder: #a8adb3; --input-color: #e6e6e6; --input-bg: #2a2e33;
    --mantine-color-gray-2: #3a4047; --mantine-color-gray-3: #4a5057;
    --mantine-color-disabled: #2a2e33; --mantine-color-disabled-color: #7d848b;
  }
  .mantine-Input-input { --input-bg: #2a2e33; --input-color: #e6e6e6; color: #e6e6e6; background: #2a2e33; }
  .mantine-Paper-root:has(.ds-says) { background: #1f2226; color: #e6e6e6; }
  .mantine-Paper-root:has(.ds-says) * { border-color: #4a5057; }
  .mantine-Paper-root:has(.ds-says) :is([role="tab"][data-active], .mantine-Slider-thumb) {
    border-color: var(--mantine-primary-color-filled); }
  .mantine-Slider-thumb, .mantine-Slider-mark:not([data-filled]), .mantine-Checkbox-input:not(:checked) { background: #2a2e33; }
  .mantine-Notification-root { background: #2a2e33; }
  .mantine-Notification-root :is(div, button) { color: DARK_INK; }
  .uplot canvas { filter: invert(0.85) hue-rotate(180deg); }
  .uplot .u-legend { color: DARK_INK; }
  div[style*="background-color"]:has(canvas[data-engine]) { background: DARK_PAGE !important; }
}
@media (max-width: 40rem) {
  .mantine-Paper-root:has(.ds-says) { left: 0 !important; right: 0 !important; width: 100% !important; max-width: none !important;
    height: var(--ds-panel) !important; max-height: var(--ds-panel) !important; }
  div:has(> .mantine-Paper-root .ds-says) > div:not(.mantine-Paper-root):has(canvas) { height: var(--ds-scene) !important; }
  .mantine-Paper-root:has(.ds-says) .mantine-ScrollArea-content { min-width: 0 !important; width: 100vw !important; }
  .mantine-Paper-root:has(.ds-says) .mantine-ScrollArea-content > div { width: 100vw !important; overflow-x: clip !important; }
}
</style>"""
    )
    .replace("DARK_INK", hexadecimal(DARK_INK))
    .replace("DARK_PAGE", hexadecimal(DARK_PAGE))
)
