// What view3d.js uses of three.js, as one script that sets THREE. To make three.min.js, in this folder:
// npm install three@0.187.0 esbuild@0.28.2 && npx esbuild entry.js --bundle --minify --format=iife --global-name=THREE --legal-comments=inline --outfile=three.min.js
export {
  AmbientLight, BufferAttribute, BufferGeometry, CanvasTexture, ColorManagement, DataTexture, DirectionalLight, DoubleSide,
  Euler, LinearSRGBColorSpace, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshLambertMaterial, Object3D,
  PerspectiveCamera, Raycaster, Scene, Sprite, SpriteMaterial, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { TransformControls } from "three/examples/jsm/controls/TransformControls.js";
