// How animals and their shadows are drawn: one instanced mesh for each look, its poses in a texture.
"use strict";

const BODY = `
  attribute float vertex;
  attribute float shade;
  attribute vec4 place;  // x, y, z, length
  attribute vec4 turn;   // yaw, pitch, roll, width of the mesh in metres
  attribute vec4 pose;   // two rows of the texture, share of the second, height of the ground
  attribute vec4 paint;  // red, green, blue, 1 if it is a leader
  uniform sampler2D poses;
  uniform float pixel;     // metres of a pixel, a metre away
  uniform float smallest;  // pixels
  uniform vec3 leaderColour;

  vec3 bodyPoint() {
    vec3 p = mix(texelFetch(poses, ivec2(int(vertex), int(pose.x)), 0).xyz,
                 texelFetch(poses, ivec2(int(vertex), int(pose.y)), 0).xyz, pose.z);
    float grown = max(1.0, smallest * pixel * distance(cameraPosition, place.xyz) / place.w);
    p *= vec3(place.w, turn.w, place.w) * grown;
    float cy = cos(turn.x), sy = sin(turn.x), cp = cos(turn.y), sp = sin(turn.y);
    vec3 ahead = vec3(cy * cp, sy * cp, sp), upright = vec3(-cy * sp, -sy * sp, cp);
    vec3 back = cos(turn.z) * upright + sin(turn.z) * cross(ahead, upright);
    return place.xyz + p.x * ahead + p.y * cross(back, ahead) + p.z * back;
  }`;

const ANIMAL_VERTEX = `${BODY}
  varying vec3 vColour;
  varying vec3 vWorld;
  void main() {
    vWorld = bodyPoint();
    vec3 colour = mix(paint.rgb, leaderColour, paint.a * step(1.1, shade));
    vColour = shade > 1.0 ? mix(colour, vec3(1.0), (shade - 1.0) * (paint.a > 0.5 ? 0.0 : 1.6)) : colour * shade;
    gl_Position = projectionMatrix * viewMatrix * vec4(vWorld, 1.0);
  }`;

const ANIMAL_PIXEL = `
  uniform vec3 sun;
  uniform vec3 haze;
  uniform float clear;
  varying vec3 vColour;
  varying vec3 vWorld;
  void main() {
    vec3 normal = normalize(cross(dFdx(vWorld), dFdy(vWorld)));
    float facing = dot(normal, sun);
    float shine = 0.66 + 0.12 * normal.z + (facing > 0.0 ? 0.44 : 0.12) * facing;
    float far = 1.0 - exp(-distance(cameraPosition, vWorld) / clear);
    gl_FragColor = vec4(mix(min(vColour * shine, vec3(1.0)), haze, 0.85 * far * far), 1.0);
  }`;

const SHADOW_VERTEX = `${BODY}
  uniform vec3 sun;
  void main() {
    vec3 p = bodyPoint();
    float high = max(p.z - pose.w, 0.0);
    p -= sun * (high / sun.z);
    p.z = pose.w + 0.0015 * distance(cameraPosition, p);
    gl_Position = projectionMatrix * viewMatrix * vec4(p, 1.0);
  }`;

const SHADOW_PIXEL = `
  uniform vec4 shadow;
  void main() { gl_FragColor = shadow; }`;

const SKY_VERTEX = `
  varying vec3 vWay;
  void main() {
    vWay = position;
    vec4 p = projectionMatrix * mat4(mat3(viewMatrix)) * vec4(position, 1.0);
    gl_Position = p.xyww;
  }`;

const SKY_PIXEL = `
  uniform vec3 horizon, zenith, land;
  varying vec3 vWay;
  void main() {
    float high = normalize(vWay).z;
    vec3 sky = mix(horizon, zenith, smoothstep(0.0, 0.55, high));
    gl_FragColor = vec4(high > 0.0 ? sky : mix(horizon, land, smoothstep(0.0, 0.06, -high)), 1.0);
  }`;

const GROUND_VERTEX = `
  varying vec2 vUv;
  varying vec3 vWorld;
  void main() {
    vUv = uv;
    vWorld = position;
    gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
  }`;

const GROUND_PIXEL = `
  uniform sampler2D map;
  uniform vec3 haze, plain;
  uniform float clear, textured;
  varying vec2 vUv;
  varying vec3 vWorld;
  void main() {
    vec3 colour = textured > 0.5 ? texture2D(map, vUv).rgb : plain;
    float far = 1.0 - exp(-distance(cameraPosition, vWorld) / clear);
    gl_FragColor = vec4(mix(colour, haze, 0.9 * far * far), 1.0);
  }`;
