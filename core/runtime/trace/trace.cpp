#include "stiction/trace.hpp"

#include <algorithm>
#include <charconv>

namespace stiction {

namespace {

std::string quoted(const char* text) {
  std::string result = "\"";
  for (; *text != '\0'; ++text) {
    const auto c = static_cast<unsigned char>(*text);
    if (c == '"' || c == '\\') result += '\\';
    result += c < 0x20 ? ' ' : *text;
  }
  return result + '"';
}

/// Nanoseconds are the last digits; the decimal point does not follow the caller's locale.
std::string decimal(double microseconds) {
  char digits[64];
  const auto [end, error] = std::to_chars(digits, digits + sizeof(digits), microseconds, std::chars_format::fixed, 3);
  return error == std::errc() ? std::string(digits, end) : "0";
}

std::string event(const Span& span) {
  std::string args;
  if (span.detail != nullptr) args += "\"detail\": " + quoted(span.detail);
  if (span.environments >= 0)
    args += (args.empty() ? "" : ", ") + ("\"environments\": " + std::to_string(span.environments));
  return "{\"name\": " + quoted(span.name) + ", \"cat\": \"" + (span.place == SpanPlace::host ? "host" : "device") +
         "\", \"ph\": \"X\", \"ts\": " + decimal(span.start) + ", \"dur\": " + decimal(span.duration) +
         ", \"pid\": " + std::to_string(static_cast<int>(span.place)) + ", \"tid\": " + std::to_string(span.lane) +
         ", \"args\": {" + args + "}}";
}

}  // namespace

Tracer::Tracer(std::size_t capacity) : capacity_(capacity) {
  spans_.reserve(capacity);
}

double Tracer::now() const noexcept {
  return std::chrono::duration<double, std::micro>(Clock::now() - made_).count();
}

void Tracer::add(const Span& span) noexcept {
  const std::lock_guard lock(mutex_);
  if (spans_.size() < capacity_)
    spans_.push_back(span);
  else
    ++left_out_;
}

void Tracer::leave_out(std::size_t count) noexcept {
  const std::lock_guard lock(mutex_);
  left_out_ += count;
}

std::vector<Span> Tracer::spans() const {
  std::vector<Span> sorted;
  {
    const std::lock_guard lock(mutex_);
    sorted = spans_;
  }
  // If spans begin at once the longer one holds the other.
  std::stable_sort(sorted.begin(), sorted.end(), [](const Span& a, const Span& b) {
    return a.start != b.start ? a.start < b.start : a.duration > b.duration;
  });
  return sorted;
}

std::size_t Tracer::left_out() const {
  const std::lock_guard lock(mutex_);
  return left_out_;
}

std::string Tracer::chrome_json() const {
  std::string json = "[";
  const char* separator = "\n";
  for (const Span& span : spans()) {
    json += separator + event(span);
    separator = ",\n";
  }
  return json + "\n]\n";
}

}  // namespace stiction
