#include "tools/gpu_first/summary.hpp"

#include "tools/gpu_first/report.hpp"

namespace stiction::gpu_first {

namespace {

constexpr std::size_t kMostWrong = 8, kMostWidth = 230;

/// The first of the lines, and how many more there are.
void add_some(std::vector<std::string>& lines, const std::vector<std::string>& all, std::size_t most) {
  const std::size_t shown = all.size() <= most ? all.size() : most - 1;
  for (std::size_t i = 0; i < shown; ++i) lines.push_back(all[i].substr(0, kMostWidth));
  if (shown < all.size()) lines.push_back("and " + std::to_string(all.size() - shown) + " more");
}

}  // namespace

void Summary::hear(const std::string& line) {
  const std::string begin = kSaid, between = " | ";
  const std::size_t middle = line.find(between);
  if (line.rfind(begin, 0) != 0 || middle == std::string::npos) return;
  const std::string subject = line.substr(begin.size(), middle - begin.size());
  std::string& text = said_[subject];
  if (text.empty()) subjects_.push_back(subject);
  text += (text.empty() ? "" : ", ") + line.substr(middle + between.size());
}

std::vector<std::string> Summary::lines(const std::string& head) const {
  std::vector<std::string> lines{head}, said;
  for (const std::string& subject : subjects_) said.push_back(subject + ": " + said_.at(subject));
  add_some(lines, wrong_, kMostWrong);
  add_some(lines, said, kMostLines - lines.size());
  return lines;
}

}  // namespace stiction::gpu_first
