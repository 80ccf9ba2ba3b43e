// engram-render: LCM logs -> video, several logs side by side.
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "sim_harness/render_log.h"
#include "sim_harness/render_scene.h"
#include "sim_harness/sim_options.h"

extern char** environ;

namespace engram::sim {
namespace {

struct RenderOptions {
  std::string scene, out, clips, camera = "overview", hand = "hand_tcp";
  std::vector<std::string> panels;  // "title=log"
  double from = 0, to = 0, fps = 25;
  int width = 1280, height = 720;
};

constexpr char kAbout[] =
    "engram-render: draws LCM logs of engram-plant into one video (H.264, by ffmpeg), off-screen.\n"
    "Without --clips, --from and --to choose the part of the run. A line of the clips file is one clip:\n"
    "  duration;title;t_begin;t_end;outcome[;t_begin;t_end;outcome ...]\n"
    "with one triple for each panel: after t_end the panel stands still and shows its outcome, green if it begins with 'ok'.";

// What one panel shows during a clip.
struct Part {
  double begin = 0, end = 0;
  std::string outcome;
};
struct Clip {
  double duration = 0;
  std::string title;
  std::vector<Part> parts;
};

std::string read_clips(const std::string& path, size_t panels, std::vector<Clip>* clips) {
  std::ifstream file(path);
  if (!file) return "cannot read the clips '" + path + "'";
  int number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> words(1);
    for (const char c : line) {
      if (c == ';') words.emplace_back();
      else words.back() += c;
    }
    if (words.size() < 2 + 3 * panels) return path + ":" + std::to_string(number) + ": too few fields for the panels; see --help";
    Clip clip;
    clip.duration = std::atof(words[0].c_str());
    clip.title = words[1];
    for (size_t i = 0; i < panels; ++i) {
      clip.parts.push_back({std::atof(words[2 + 3 * i].c_str()), std::atof(words[3 + 3 * i].c_str()), words[4 + 3 * i]});
    }
    clips->push_back(clip);
  }
  return clips->empty() ? path + ": no clip" : "";
}

// ffmpeg as a child that reads raw frames from a pipe.
class Encoder {
 public:
  std::string open(const RenderOptions& o) {
    std::signal(SIGPIPE, SIG_IGN);
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) return "cannot open a pipe";
    const std::string size = std::to_string(o.width) + "x" + std::to_string(o.height), fps = std::to_string(o.fps);
    const char* arguments[] = {"ffmpeg", "-loglevel", "error",      "-y",        "-f",         "rawvideo",    "-pix_fmt",
                               "rgb24",  "-s",        size.c_str(), "-r",        fps.c_str(),  "-i",          "-",
                               "-vf",    "vflip",     "-c:v",       "libx264",   "-preset",    "veryfast",    "-crf",
                               "23",     "-pix_fmt",  "yuv420p",    "-movflags", "+faststart", o.out.c_str(), nullptr};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], 0);
    const int error = posix_spawnp(&child_, "ffmpeg", &actions, nullptr, const_cast<char**>(arguments), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[0]);
    pipe_ = ends[1];
    return error ? "cannot start ffmpeg; install it" : "";
  }

  bool write(const unsigned char* bytes, size_t size) {
    while (size > 0) {
      const ssize_t written = ::write(pipe_, bytes, size);
      if (written <= 0) return false;
      bytes += written, size -= static_cast<size_t>(written);
    }
    return true;
  }

  bool finish() {
    close(pipe_);
    int status = 1;
    waitpid(child_, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

 private:
  pid_t child_ = 0;
  int pipe_ = -1;
};

// Panels in a grid that is about as wide as high.
std::vector<mjrRect> layout(size_t panels, int width, int height) {
  const int columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(panels))));
  const int rows = (static_cast<int>(panels) + columns - 1) / columns;
  std::vector<mjrRect> rects;
  for (int i = 0; i < static_cast<int>(panels); ++i) {
    const int column = i % columns, row = rows - 1 - i / columns;
    rects.push_back({column * width / columns, row * height / rows, width / columns, height / rows});
  }
  return rects;
}

int fail(const std::string& what) {
  std::fprintf(stderr, "engram-render: %s\n", what.c_str());
  return 2;
}

int render_main(int argc, char** argv) {
  RenderOptions o;
  parse_options(argc, argv, kAbout,
                {{"--scene", "FILE", "MJCF that the logs were made with", &o.scene},
                 {"--panel", "TITLE=LOG", "one log; repeat for several side by side", &o.panels},
                 {"--out", "FILE.mp4", "the video", &o.out},
                 {"--clips", "FILE", "which parts to show", &o.clips},
                 {"--from", "S", "without --clips: first plant time", &o.from},
                 {"--to", "S", "without --clips: last plant time; default the end of the first log", &o.to},
                 {"--width", "PIXELS", "of the picture; default 1280", &o.width},
                 {"--height", "PIXELS", "default 720", &o.height},
                 {"--fps", "N", "frames per second; default 25", &o.fps},
                 {"--camera", "NAME", "camera of the scene; default overview", &o.camera},
                 {"--hand", "SITE", "site whose trail is drawn; default hand_tcp", &o.hand}});
  install_mujoco_handlers("engram-render");
  if (o.scene.empty() || o.panels.empty() || o.out.empty()) return fail("--scene, --panel and --out are needed; see --help");
  if (o.fps <= 0 || o.width < 16 || o.height < 16 || o.width % 2 || o.height % 2)
    return fail("width and height must be even and positive");

  const size_t n = o.panels.size();
  std::vector<Clip> clips;
  std::string wrong = o.clips.empty() ? "" : read_clips(o.clips, n, &clips);
  if (!wrong.empty()) return fail(wrong);

  std::vector<RunLog> logs(n);
  std::vector<std::string> titles(n);
  for (size_t i = 0; i < n; ++i) {
    const size_t equal = o.panels[i].find('=');
    if (equal == std::string::npos) return fail("--panel takes TITLE=LOG");
    titles[i] = o.panels[i].substr(0, equal);
    std::vector<TimeRange> ranges;
    for (const Clip& clip : clips) ranges.push_back({clip.parts[i].begin, clip.parts[i].end});
    if (clips.empty() && o.to > 0) ranges.push_back({o.from, o.to});
    wrong = logs[i].read(o.panels[i].c_str() + equal + 1, ranges);
    if (!wrong.empty()) return fail(wrong);
  }
  if (clips.empty()) {
    const double end = o.to > 0 ? o.to : logs[0].end;
    clips.push_back({end - o.from, "", std::vector<Part>(n, Part{o.from, end, ""})});
  }

  Scene scene;
  wrong = scene.open(o.scene.c_str(), o.camera.c_str(), o.hand.c_str(), o.width, o.height);
  Encoder encoder;
  if (wrong.empty()) wrong = encoder.open(o);
  if (!wrong.empty()) return fail(wrong);

  int total = 0, done = 0;
  for (const Clip& clip : clips) total += static_cast<int>(clip.duration * o.fps);
  const std::vector<mjrRect> rects = layout(n, o.width, o.height);
  const auto start = std::chrono::steady_clock::now();
  for (const Clip& clip : clips) {
    std::vector<Panel> panels(n);
    const int frames = static_cast<int>(clip.duration * o.fps);
    for (int frame = 0; frame < frames; ++frame) {
      for (size_t i = 0; i < n; ++i) {
        const Part& part = clip.parts[i];
        const double wanted = part.begin + frame / o.fps, t = std::min(wanted, part.end);
        const bool still = wanted > part.end + 1.5 / o.fps;  // the panel stands as it was drawn before
        if (still && frame > 2) continue;
        const auto utime = static_cast<int64_t>(t * 1e6 + 0.5);
        Panel& panel = panels[i];
        panel.rect = rects[i];
        panel.q = latest(logs[i].q, utime);
        panel.target = latest(logs[i].task, utime);
        panel.plan = latest(logs[i].path, utime);
        panel.title = titles[i];
        char note[64];
        std::snprintf(note, sizeof note, "%s %.2f s", clip.title.c_str(), t - part.begin);
        panel.note = note;
        if (wanted >= part.end - 0.5 / o.fps && !part.outcome.empty()) {
          panel.outcome = part.outcome;
          panel.state = part.outcome.rfind("ok", 0) == 0 ? Panel::kSuccess : Panel::kFailure;
        }
        if (panel.q && wanted <= part.end) panel.trail.push_back(scene.pose(*panel.q));
        scene.draw(panel);
      }
      if (!encoder.write(scene.pixels(), static_cast<size_t>(3) * o.width * o.height))
        return fail("ffmpeg has stopped; is the disk full?");
      if (++done % 25 == 0 || done == total) {
        const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        std::printf("frame %d/%d, %.0f s left\n", done, total, elapsed / done * (total - done));
        std::fflush(stdout);
      }
    }
  }
  if (!encoder.finish()) return fail("ffmpeg could not write '" + o.out + "'; is the disk full?");
  return 0;
}

}  // namespace
}  // namespace engram::sim

int main(int argc, char** argv) { return engram::sim::render_main(argc, argv); }
