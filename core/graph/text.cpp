#include "core/graph/text.hpp"

#include <array>
#include <charconv>
#include <cmath>

namespace stiction::graph {
namespace {

constexpr std::array kPalette = {"#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1",
                                 "#76b7b2", "#edc948", "#9c755f", "#ff9da7", "#7f7f7f"};

std::string hex(double share) {
  constexpr const char* kDigits = "0123456789abcdef";
  const auto byte = static_cast<unsigned>(std::lround(share * 255));
  return {kDigits[byte / 16], kDigits[byte % 16]};
}

}  // namespace

std::string fixed_text(double value, int digits) {
  std::array<char, 400> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed, digits);
  const std::string text(buffer.data(), end.ptr);
  const bool is_minus_zero = text.front() == '-' && text.find_first_not_of("-0.") == std::string::npos;
  return is_minus_zero ? text.substr(1) : text;
}

std::string counted(Offset count, const char* one, const char* many) {
  return std::to_string(count) + ' ' + (count == 1 ? one : many);
}

std::string escape_dot(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '"' || c == '\\') safe += '\\';
    safe += c == '\0' ? ' ' : c;
  }
  return safe;
}

std::string escape_xml(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '&') {
      safe += "&amp;";
    } else if (c == '<') {
      safe += "&lt;";
    } else if (c == '>') {
      safe += "&gt;";
    } else if (c == '"') {
      safe += "&quot;";
    } else {
      safe += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;  // XML has no way to write most of those
    }
  }
  return safe;
}

std::string color_hex(Index color) {
  if (color < static_cast<Index>(kPalette.size())) return kPalette[static_cast<std::size_t>(color)];
  const double turn = 0.6180339887498949 * color;
  const double hue = 6 * (turn - std::floor(turn));
  const double value = color % 2 == 0 ? 0.85 : 0.6, least = 0.35 * value;
  std::string text = "#";
  for (const double shift : {5.0, 3.0, 1.0}) {  // red, green, blue: a trapezoid in hue, each shifted by a third
    const double k = shift + hue - 6 * std::floor((shift + hue) / 6);
    const double rise = k < 4 - k ? k : 4 - k;
    const double slope = rise < 0 ? 0 : rise > 1 ? 1 : rise;
    text += hex(value - (value - least) * slope);
  }
  return text;
}

}  // namespace stiction::graph
