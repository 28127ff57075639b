#include "cli/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <utility>

namespace stiction::cli {

namespace {

constexpr int kBarWidth = 30;
constexpr std::size_t kLineWidth = 78;
constexpr auto kPeriod = std::chrono::milliseconds(100);

bool is_set(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr && *value != '\0';
}

bool stderr_can_redraw() {
  const char* term = std::getenv("TERM");
  return isatty(STDERR_FILENO) != 0 && !(term != nullptr && std::string_view(term) == "dumb");
}

std::string clock_text(double seconds) {
  const auto whole = static_cast<long>(seconds);
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
}

}  // namespace

Progress::Progress(std::string label, std::int64_t total, bool quiet) : total_(total), label_(std::move(label)) {
  if (quiet || !stderr_can_redraw()) return;
  colour_ = !is_set("NO_COLOR");
  thread_ = std::thread([this] { draw_until_stopped(); });
}

Progress::~Progress() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
  fmt::print(stderr, "\r{:{}}\r", "", kLineWidth);
}

void Progress::relabel(std::string label) {
  const std::lock_guard lock(mutex_);
  label_ = std::move(label);
}

void Progress::draw_until_stopped() {
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, kPeriod, [this] { return stop_; })) {
    const std::string text = line(label_);
    const std::size_t padding = text.size() < kLineWidth ? kLineWidth - text.size() : 0;
    const char* on = colour_ ? "\x1b[32m" : "";
    const char* off = colour_ ? "\x1b[0m" : "";
    fmt::print(stderr, "\r{}{}{}{:{}}", on, text, off, "", padding);
    std::fflush(stderr);
  }
}

std::string Progress::line(const std::string& label) const {
  const double elapsed = std::chrono::duration<double>(Clock::now() - start_).count();
  if (total_ <= 0) return fmt::format("{:<16.16} {}", label, clock_text(elapsed));
  const std::int64_t done = done_.load(std::memory_order_relaxed);
  const double share = static_cast<double>(done) / static_cast<double>(total_);
  const int filled = static_cast<int>(share * kBarWidth);
  const std::string left = done > 0 ? clock_text(elapsed / share - elapsed) : "?";
  return fmt::format("{:<16.16} [{:#<{}}{:.<{}}] {}/{}  {} left", label, "", filled, "", kBarWidth - filled, done,
                     total_, left);
}

}  // namespace stiction::cli
