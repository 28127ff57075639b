#include "tools/gpu_first/child.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "stiction/error.hpp"
#include "tools/gpu_first/report.hpp"

namespace stiction::gpu_first {

namespace {

constexpr std::size_t kKept = 2000;  ///< characters of the output
constexpr int kPollMs = 20;

/// Text that a pipe brings: its end, and each whole line.
class Heard {
 public:
  explicit Heard(const std::function<void(const std::string&)>& hear) : hear_(hear) {}

  /// As far as it is there now.
  void read_some(int pipe) {
    char buffer[4096];
    for (ssize_t count = 0; (count = read(pipe, buffer, sizeof buffer)) > 0;) {
      text_.append(buffer, static_cast<std::size_t>(count));
      line_.append(buffer, static_cast<std::size_t>(count));
    }
    if (text_.size() > kKept) text_.erase(0, text_.size() - kKept);
    for (std::size_t end = 0; (end = line_.find('\n')) != std::string::npos; line_.erase(0, end + 1))
      if (hear_) hear_(line_.substr(0, end));
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  const std::function<void(const std::string&)>& hear_;
  std::string text_, line_;
};

}  // namespace

Ending run_child(const std::vector<std::string>& command, double limit_s,
                 const std::function<void(const std::string&)>& hear) {
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw Error(ErrorCode::io, "no pipe can be made: close some files");
  const double start = wall_seconds();
  const pid_t child = fork();
  if (child < 0) throw Error(ErrorCode::io, "no process can be made: end some");
  if (child == 0) {
    // A group of its own, so that its children end with it; and it ends where this process does.
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(ends[1], STDOUT_FILENO);
    dup2(ends[1], STDERR_FILENO);
    execvp(words[0], words.data());
    _exit(127);
  }
  setpgid(child, child);
  close(ends[1]);
  fcntl(ends[0], F_SETFL, O_NONBLOCK);
  Ending ending;
  Heard heard(hear);
  int status = 0;
  for (;;) {
    pollfd ready{ends[0], POLLIN, 0};
    if (poll(&ready, 1, kPollMs) > 0) {
      heard.read_some(ends[0]);
      // The pipe stays ready once the process has ended.
      if ((ready.revents & POLLHUP) != 0) usleep(1000 * kPollMs / 4);
    }
    if (waitpid(child, &status, WNOHANG) == child) break;
    ending.seconds = wall_seconds() - start;
    if (ending.seconds <= limit_s) continue;
    kill(-child, SIGKILL);
    // A process inside of a driver's call may not end; it must not hold up the rest.
    for (int wait = 0; wait < 100 && waitpid(child, &status, WNOHANG) == 0; ++wait) usleep(1000 * kPollMs);
    ending.kind = Ending::Kind::out_of_time;
    break;
  }
  kill(-child, SIGKILL);
  heard.read_some(ends[0]);
  ending.printed = heard.text();
  close(ends[0]);
  ending.seconds = wall_seconds() - start;
  if (ending.kind == Ending::Kind::out_of_time) return ending;
  ending.kind = WIFSIGNALED(status) ? Ending::Kind::signalled : Ending::Kind::exited;
  ending.number = WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status);
  return ending;
}

}  // namespace stiction::gpu_first
