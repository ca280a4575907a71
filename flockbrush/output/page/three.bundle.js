// three.min.js is this file bundled, three 0.187.0 (MIT, three.LICENSE.txt):
//   npm install three@0.187.0 esbuild@0.25
//   npx esbuild three.bundle.js --bundle --minify --format=iife --global-name=THREE --target=es2020 --outfile=three.min.js
export * from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
