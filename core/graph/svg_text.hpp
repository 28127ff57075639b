#pragma once

#include <string>

#include "core/graph/layout.hpp"

namespace stiction::graph {

/// Colours of texts: titles, and explanations.
inline constexpr const char* kInk = "#333a45";
inline constexpr const char* kPale = "#6b7480";

/// SVG elements, one after the other. Lengths in pixels, y downward; texts are escaped here.
class SvgText {
 public:
  void line(Point from, Point to, const std::string& color, double width);
  void rect(Point corner, Point size, double round, const std::string& fill, const std::string& stroke);
  void circle(Point centre, double radius, const std::string& fill, const std::string& stroke);
  /// `anchor` is start, middle or end; the baseline is at `at`.
  void text(Point at, double size, const char* anchor, const std::string& color, const std::string& words,
            bool bold = false);
  /// Text up to end_group shows `words` when pointed at.
  void begin_group(const std::string& words);
  void end_group();
  /// The whole document.
  [[nodiscard]] std::string document(Point size, const std::string& title) const;

 private:
  std::string body_;
};

}  // namespace stiction::graph
