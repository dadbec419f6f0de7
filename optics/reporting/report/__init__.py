"""The report as a page, and the files of its light."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .html import PageSection, Report, check_page, figures_html, page_head, report_html, section_page
    from .irradiance_files import light_files
    from .small_pictures import light_pictures

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
