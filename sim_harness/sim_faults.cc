#include "sim_harness/sim_faults.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>

namespace engram::sim {

constexpr double kSlide = 1e-5;  // kg

std::string Faults::init(const FaultOptions& options, const Model& model) {
  options_ = options;
  random_.seed(options.seed);
  now_.assign(model.nu, 0.0);
  for (const std::string& text : options.pushes) {
    std::vector<std::string> words;
    std::stringstream stream(text);
    for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
    const std::string form = "--push '" + text + "': the form is t,body,fx,fy,fz,duration";
    if (words.size() != 6) return form;
    Push push;
    push.body = mj_name2id(model.m, mjOBJ_BODY, words[1].c_str());
    if (push.body < 1) return form + "; the scene has no body '" + words[1] + "'";
    double* number[] = {&push.t, nullptr, &push.force[0], &push.force[1], &push.force[2], &push.duration};
    for (int i = 0; i < 6; ++i) {
      if (i == 1) continue;
      char* end = nullptr;
      *number[i] = std::strtod(words[i].c_str(), &end);
      if (end == words[i].c_str() || *end || !std::isfinite(*number[i])) return form;
    }
    pushes_.push_back(push);
  }
  options_.gust.smooth = true;
  for (RandomPushes* random : {&options_.random_push, &options_.gust}) random->next = random->period;
  return "";
}

double Push::share(double now) const {
  if (now < t || now >= t + duration) return 0;
  return smooth ? 0.5 * (1 - std::cos(6.283185307179586 * (now - t) / duration)) : 1;
}

void Faults::add(Push push, double now) {
  push.t += now;
  pushes_.push_back(push);
}

void Faults::measure(const Model& model, double* q, double* v) {
  if (options_.noise_q > 0) {
    for (int i = model.free_base ? 7 : 0; i < model.nq; ++i) q[i] += options_.noise_q * normal_(random_);
  }
  if (options_.noise_v > 0) {
    for (int i = 0; i < model.nv; ++i) v[i] += options_.noise_v * normal_(random_);
  }
}

const double* Faults::delay(const Model& model, const double* tau) {
  if (options_.latency == 0) return tau;
  if (queue_.empty()) {
    const double* bias = model.d->qfrc_bias + model.nv - model.nu;
    queue_.assign(options_.latency, std::vector<double>(bias, bias + model.nu));
  }
  now_ = queue_.front();
  queue_.pop_front();
  queue_.emplace_back(tau, tau + model.nu);
  return now_.data();
}

void Faults::strike(RandomPushes* random, const Model& model, double t) {
  if (random->period <= 0 || t < random->next) return;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Push push;
  push.t = t;
  do {  // a body that moves, and is more than a slide
    push.body = 1 + static_cast<int>(uniform(random_) * (model.m->nbody - 1));
  } while (model.m->body_weldid[push.body] == 0 || model.m->body_mass[push.body] <= kSlide);
  const double height = 2.0 * uniform(random_) - 1.0, turn = 6.283185307179586 * uniform(random_);
  const double level = std::sqrt(1.0 - height * height);
  const double force = random->force * uniform(random_);
  push.force[0] = force * level * std::cos(turn), push.force[1] = force * level * std::sin(turn), push.force[2] = force * height;
  push.duration = random->duration;
  push.smooth = random->smooth;
  pushes_.push_back(push);
  random->next = t - random->period * std::log(1.0 - uniform(random_));
}

void Faults::push(Model* model, double t) {
  strike(&options_.random_push, *model, t);
  strike(&options_.gust, *model, t);
  if (pushes_.empty()) return;
  mju_zero(model->d->xfrc_applied, 6 * model->m->nbody);
  for (const Push& push : pushes_) {
    mju_addToScl3(model->d->xfrc_applied + 6 * push.body, push.force, push.share(t));
    mju_addToScl3(model->d->xfrc_applied + 6 * push.body + 3, push.torque, push.share(t));
  }
  const auto over = [t](const Push& push) { return t >= push.t + push.duration; };
  pushes_.erase(std::remove_if(pushes_.begin(), pushes_.end(), over), pushes_.end());
}

}  // namespace engram::sim
