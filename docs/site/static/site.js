// Listings and tables may be wider than the page: the keyboard has to reach them to scroll.
document.addEventListener("DOMContentLoaded", () => {
  for (const wide of document.querySelectorAll("pre, .table-wrapper")) wide.tabIndex = 0;
});
