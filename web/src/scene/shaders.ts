// Shaders of part and tool paths.

export const PART_VERTEX = /* glsl */ `
in float left_; in float judged; in vec3 wall;
out vec3 vNormal_; out vec3 vPlace; out float vLeft; out float vJudged; out vec3 vWall; out vec3 vEye;
void main() {
  vec4 here = modelViewMatrix * vec4(position, 1.0);
  vPlace = position; vLeft = left_; vJudged = judged; vWall = wall;
  vNormal_ = normalMatrix * normal; vEye = -here.xyz;
  gl_Position = projectionMatrix * here;
}`;

export const PART_FRAGMENT = /* glsl */ `
precision highp float;
in vec3 vNormal_; in vec3 vPlace; in float vLeft; in float vJudged; in vec3 vWall; in vec3 vEye;
out vec4 outColour;
uniform int mode; uniform vec3 own; uniform int hatched; uniform float faded; uniform float lit; uniform vec4 section;
uniform float limits[6]; uniform vec3 classes[7]; uniform vec3 uncut; uniform vec3 pale; uniform vec3 stripe;
uniform vec3 cap; uniform vec3 paper;
float stripes(float width) { return step(0.62, fract((gl_FragCoord.x + gl_FragCoord.y) / width)); }
void main() {
  if (dot(section.xyz, vPlace) > section.w) discard;
  if (!gl_FrontFacing) {
    outColour = vec4(mix(cap, cap * 0.82, stripes(9.0)), 1.0);
    return;
  }
  vec3 base = own; bool lines = hatched == 1; vec3 ink = stripe;
  if (mode == 1) { base = vWall; lines = false; }
  if (mode == 2) {
    lines = false; base = pale;
    if (vJudged > 0.25) {
      int k = 0;
      for (int i = 0; i < 6; i++) if (vLeft > limits[i]) k = i + 1;
      base = classes[k];
      if (vJudged > 1.5) { base = uncut; lines = true; ink = vec3(0.36, 0.36, 0.40); }
    }
  }
  base = mix(base, paper, faded);
  if (lines) base = mix(base, mix(ink, paper, 0.5 * faded), stripes(8.0));
  vec3 n = normalize(vNormal_), eye = normalize(vEye);
  float shade = 0.62 + 0.26 * max(dot(n, normalize(vec3(-0.35, 0.55, 0.75))), 0.0) + 0.14 * max(dot(n, eye), 0.0);
  outColour = vec4(base * mix(1.0, shade + lit, 0.92), 1.0);
}`;

export const PATH_VERTEX = /* glsl */ `
in float time; out vec3 vPlace; out float vTime;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  vPlace = position; vTime = time;
  gl_Position = projectionMatrix * vec4(eye.xyz * 0.9985, 1.0); // a little nearer, at the same place of the frame
}`;

export const PATH_FRAGMENT = /* glsl */ `
precision highp float;
in vec3 vPlace; in float vTime; out vec4 outColour;
uniform vec3 colour; uniform float strength; uniform float now; uniform vec4 section; uniform float dashed;
void main() {
  if (dot(section.xyz, vPlace) > section.w) discard;
  if (dashed > 0.5 && fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0) > 0.55) discard;
  float seen = vTime <= now ? strength : 0.10 * strength;
  if (seen < 0.02) discard;
  outColour = vec4(colour, seen);
}`;
