"""Links that leave docs/ name a file of the repository: on the site they are told as such. One that leads nowhere is an error."""

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parent
LINK = re.compile(r"(!?)\[([^\]]*)\]\((\.\./[^)#\s]+)(#[^)\s]*)?\)")


def on_page_markdown(markdown, page, **_):
    """The page with such links as text."""

    def told(match):
        path = DOCS / page.file.src_uri
        target = (path.parent / match[3]).resolve()
        if match[1] or not target.exists():
            raise ValueError(f"{page.file.src_uri}: {match[0]} leads nowhere on the site")
        shown = target.relative_to(DOCS.parent).as_posix()
        words = "" if match[2].strip("`") in (shown, match[3]) else f"{match[2]} "
        return f"{words}(`{shown}` in the repository)" if words else f"`{shown}` in the repository"

    return LINK.sub(told, markdown)
