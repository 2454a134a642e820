"""Lines on a formed sheet and in its flat pattern: sections, draw-in, trimming line, outline."""

from __future__ import annotations
