#include "tools/gpu_first/report.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <fstream>

#include "stiction/error.hpp"

namespace stiction::gpu_first {

std::string hex(std::uint64_t hash) {
  char text[19];
  std::snprintf(text, sizeof text, "0x%016llx", static_cast<unsigned long long>(hash));
  return text;
}

std::uint64_t joined(const Hashes& hashes) {
  std::uint64_t all = 0xcbf29ce484222325ULL;
  for (const std::uint64_t hash : hashes) all = (all ^ hash) * 0x100000001b3ULL;
  return all;
}

void append_line(const std::string& path, const std::string& line) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  const std::string whole = line + "\n";
  const bool done = file >= 0 && write(file, whole.data(), whole.size()) == static_cast<ssize_t>(whole.size());
  if (file >= 0) close(file);
  if (!done) throw Error(ErrorCode::io, path + " cannot be written: give another --out");
}

Report::Report(const Setting& setting, Target* target, std::string check)
    : setting_(setting), target_(target), check_(std::move(check)) {
  std::ifstream file(setting.hashes);
  std::string line;
  while (std::getline(file, line)) {
    const std::size_t comma = line.rfind(',');
    if (comma != std::string::npos) committed_[line.substr(0, comma)] = line.substr(comma + 1);
  }
}

JsonLine Report::begin(const std::string& part, const std::string& result) const {
  JsonLine line;
  line.add("check", check_);
  if (!part.empty()) line.add("part", part);
  line.add("result", result);
  return line;
}

void Report::write(const JsonLine& line) const {
  if (!setting_.out.empty()) append_line(setting_.out, line.text());
  std::printf("%s\n", line.text().c_str());
  std::fflush(stdout);
}

std::string Report::key(const std::string& part) const {
  return check_ + "," + part + "," + setting_.size();
}

void Report::compare(const std::string& part, const std::function<Hashes()>& here, const std::function<Hashes()>& there,
                     const std::function<void(JsonLine&, std::size_t)>& describe) {
  const double start = wall_seconds();
  const Hashes expected = here();
  const double middle = wall_seconds();
  const std::string own = hex(joined(expected));
  if (!setting_.write_hashes.empty()) append_line(setting_.write_hashes, key(part) + "," + own);
  const auto known = committed_.find(key(part));
  const bool is_known = known != committed_.end(), is_committed = is_known && known->second == own;

  Hashes actual = expected;
  std::string failure;
  if (target_ != nullptr) {
    try {
      actual = there();
    } catch (const Error& error) {
      failure = error.what();
    }
  }
  const double end = wall_seconds();
  std::size_t first = 0, count = 0;
  for (std::size_t i = actual.size(); i-- > 0;) {
    if (i < expected.size() && actual[i] == expected[i]) continue;
    first = i;
    ++count;
  }
  const bool same = failure.empty() && count == 0 && actual.size() == expected.size();
  const bool wrong_here = is_known && !is_committed;
  good_ = good_ && same && !wrong_here;
  const char* const result = !failure.empty()                ? "error"
                             : !same                         ? "different"
                             : wrong_here                    ? "not what is committed"
                             : setting_.write_hashes.empty() ? "equal"
                                                             : "written";
  JsonLine line = begin(part, result);
  line.add("committed", is_committed ? "equal" : is_known ? "differs" : "unknown");
  line.add("items", expected.size()).add("hash_cpu", own);
  if (failure.empty() && target_ != nullptr) line.add("hash_device", hex(joined(actual)));
  if (wrong_here) line.add("hash_committed", known->second);
  line.add("seconds_cpu", middle - start).add("seconds_device", end - middle);
  if (!failure.empty()) line.add("error", failure);
  if (failure.empty() && !same) {
    line.add("different", count).add("first", first);
    if (describe) describe(line, first);
  }
  write(line);
}

void Report::judge(const std::string& part, const std::string& what) {
  good_ = good_ && what.empty();
  JsonLine line = begin(part, what.empty() ? "right" : "wrong");
  if (!what.empty()) line.add("what", what);
  write(line);
}

void Report::measured(const std::string& part, const std::function<void(JsonLine&)>& numbers) {
  JsonLine line = begin(part, "measured");
  numbers(line);
  write(line);
}

void Report::say(const std::string& subject, const std::string& text) {
  std::printf("%s%s | %s\n", kSaid, subject.c_str(), text.c_str());
  std::fflush(stdout);
}

void Report::left_out(const std::string& part, const std::string& why) {
  write(begin(part, "left out").add("why", why));
}

}  // namespace stiction::gpu_first
