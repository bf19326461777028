startImages();
startPlots();
timeline.start();
startView3d().catch(error => {
  get("view3d-message").textContent = "The 3D view could not be made: " + error.message;
  get("view3d-message").hidden = false;
});
