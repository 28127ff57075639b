#include "core/graph/svg_text.hpp"

#include "core/graph/text.hpp"

namespace stiction::graph {
namespace {

std::string quoted(const char* name, double value) {
  return std::string(" ") + name + "=\"" + fixed_text(value, 1) + "\"";
}

std::string quoted(const char* name, const std::string& value) {
  return std::string(" ") + name + "=\"" + value + "\"";
}

}  // namespace

void SvgText::line(Point from, Point to, const std::string& color, double width) {
  body_ += "<line" + quoted("x1", from.x) + quoted("y1", from.y) + quoted("x2", to.x) + quoted("y2", to.y) +
           quoted("stroke", color) + quoted("stroke-width", width) + "/>\n";
}

void SvgText::rect(Point corner, Point size, double round, const std::string& fill, const std::string& stroke) {
  body_ += "<rect" + quoted("x", corner.x) + quoted("y", corner.y) + quoted("width", size.x) +
           quoted("height", size.y) + quoted("rx", round) + quoted("fill", fill) + quoted("stroke", stroke) + "/>\n";
}

void SvgText::circle(Point centre, double radius, const std::string& fill, const std::string& stroke) {
  body_ += "<circle" + quoted("cx", centre.x) + quoted("cy", centre.y) + quoted("r", radius) + quoted("fill", fill) +
           quoted("stroke", stroke) + "/>\n";
}

void SvgText::text(Point at, double size, const char* anchor, const std::string& color, const std::string& words,
                   bool bold) {
  body_ += "<text" + quoted("x", at.x) + quoted("y", at.y) + quoted("font-size", size) +
           quoted("text-anchor", std::string(anchor)) + quoted("fill", color) + (bold ? " font-weight=\"bold\"" : "") +
           ">" + escape_xml(words) + "</text>\n";
}

void SvgText::begin_group(const std::string& words) {
  body_ += "<g><title>" + escape_xml(words) + "</title>\n";
}

void SvgText::end_group() {
  body_ += "</g>\n";
}

std::string SvgText::document(Point size, const std::string& title) const {
  const std::string width = fixed_text(size.x, 0), height = fixed_text(size.y, 0);
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + width +
         "\" height=\"" + height + "\" viewBox=\"0 0 " + width + " " + height +
         "\" font-family=\"Helvetica, Arial, sans-serif\" stroke-linecap=\"round\">\n<title>" + escape_xml(title) +
         "</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n" + body_ + "</svg>\n";
}

}  // namespace stiction::graph
