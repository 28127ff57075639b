#include "core/graph/svg_spectrum.hpp"

#include "core/graph/slots.hpp"
#include "core/graph/text.hpp"

namespace stiction::graph {
namespace {

constexpr const char* kBlue = "#4e79a7";
constexpr const char* kRed = "#e15759";

/// A step of 1, 2 or 5 times a power of ten that divides `range` into at most five parts.
double nice_step(double range) {
  double step = 1e-6;
  for (int k = 0; 5 * step < range * (1 - 1e-12); ++k) step *= k % 3 == 1 ? 2.5 : 2;
  return step;
}

}  // namespace

void draw_spectrum(SvgText& svg, Point corner, Point size, const std::vector<double>& spectrum, Offset zero_count) {
  svg.rect(corner, size, 8, "#ffffff", "#cfd4db");
  svg.text({corner.x + 12, corner.y + 19}, 12, "start", "#333a45", "Laplacian spectrum", true);
  std::string words = counted(zero_count, "zero", "zeros") + " (one for each island)";
  const double largest = spectrum.empty() ? 0 : spectrum.back();
  const bool has_edges = at(zero_count) < spectrum.size();
  if (has_edges) {
    const double smallest = spectrum[at(zero_count)];
    words += ", then " + fixed_text(smallest, 3) + " to " + fixed_text(largest, 3) + ", ratio " +
             fixed_text(largest / smallest, 1);
  }
  svg.text({corner.x + 12, corner.y + 35}, 11, "start", kPale, words);
  const Point low{corner.x + 42, corner.y + size.y - 34}, high{corner.x + size.x - 18, corner.y + 52};
  const double top = has_edges ? 1.04 * largest : 1;
  const auto place = [&](double share, double value) {
    return Point{low.x + share * (high.x - low.x), low.y + value / top * (high.y - low.y)};
  };
  const double step = nice_step(top);
  for (int k = 0; k * step <= top; ++k) {
    const Point mark = place(0, k * step);
    svg.line(mark, {high.x, mark.y}, k == 0 ? "#9aa2ad" : "#e6e9ed", 1);
    svg.text({mark.x - 6, mark.y + 3.5}, 10, "end", kPale, fixed_text(k * step, step < 1 ? 2 : 0));
  }
  const auto count = static_cast<double>(spectrum.size());
  for (std::size_t i = 0; i < spectrum.size(); ++i) {
    const Point dot = place((static_cast<double>(i) + 0.5) / count, spectrum[i] > 0 ? spectrum[i] : 0);
    svg.circle(dot, count > 120 ? 1.6 : 2.6, i < at(zero_count) ? kRed : kBlue, "none");
  }
  svg.text({0.5 * (low.x + high.x), low.y + 20}, 10, "middle", kPale,
           "eigenvalues 1 to " + std::to_string(spectrum.size()) + ", ascending");
}

}  // namespace stiction::graph
