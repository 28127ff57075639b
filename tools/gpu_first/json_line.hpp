#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace stiction::gpu_first {

/// One object of JSON on one line.
class JsonLine {
 public:
  JsonLine& add(std::string_view name, std::string_view text) {
    begin(name);
    text_ += quoted(text);
    return *this;
  }
  JsonLine& add(std::string_view name, const char* text) { return add(name, std::string_view(text)); }
  JsonLine& add(std::string_view name, double value) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.6g", value);
    // JSON has neither infinities nor NaN.
    const bool finite = value - value == 0;
    begin(name);
    text_ += finite ? std::string(digits) : quoted(digits);
    return *this;
  }
  JsonLine& add(std::string_view name, std::int64_t value) {
    begin(name);
    text_ += std::to_string(value);
    return *this;
  }
  JsonLine& add(std::string_view name, int value) { return add(name, std::int64_t{value}); }
  JsonLine& add(std::string_view name, std::size_t value) { return add(name, static_cast<std::int64_t>(value)); }

  [[nodiscard]] std::string text() const { return text_ + "}"; }

 private:
  void begin(std::string_view name) { text_ += (text_.size() > 1 ? ", " : "") + quoted(name) + ": "; }
  static std::string quoted(std::string_view text) {
    std::string result = "\"";
    for (const char c : text) {
      if (c == '"' || c == '\\') result += '\\';
      if (c == '\n') {
        result += "\\n";
      } else {
        result += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
      }
    }
    return result + "\"";
  }

  std::string text_ = "{";
};

}  // namespace stiction::gpu_first
