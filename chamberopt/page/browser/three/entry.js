// What the views in 3D use of three.js, as one script that sets THREE. To make three.min.js, in this folder:
// npm install three@0.187.0 esbuild@0.28.2 && npx esbuild entry.js --bundle --minify --format=iife --global-name=THREE --legal-comments=inline --outfile=three.min.js
export {
  AlwaysStencilFunc, AmbientLight, BackSide, BufferAttribute, BufferGeometry, CanvasTexture, ColorManagement, DataTexture,
  DecrementWrapStencilOp, DirectionalLight, DoubleSide, Euler, FrontSide, IncrementWrapStencilOp, LinearSRGBColorSpace,
  LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, NotEqualStencilFunc, Object3D,
  PerspectiveCamera, Plane, Raycaster, ReplaceStencilOp, Scene, Sprite, SpriteMaterial, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { TransformControls } from "three/examples/jsm/controls/TransformControls.js";
